"""The phases of a command on its way to its effect: the table is the whole truth.

A pair that it does not list raises. See effect.py for what drives it.
"""

from __future__ import annotations

import enum


class Phase(enum.Enum):
    """Where the loop is."""

    WAIT_ACKNOWLEDGEMENT = "waiting for the acknowledgement, or to be sent where there is none"
    WAIT_EFFECT = "waiting for the effect"
    WAIT_RETRY = "waiting to try again"
    CONFIRMED = "confirmed"
    FAILED = "failed"


class Happening(enum.Enum):
    """What can happen to it."""

    ACCEPTED = "accepted"
    SENT_UNACKNOWLEDGED = "sent where nothing is acknowledged"
    NOT_NOW = "refused or unanswered, worth another try"
    REFUSED = "refused for good"
    EFFECT_SHOWN = "effect shown"
    EFFECT_LATE = "effect overdue"
    RETRY_DUE = "time to try again"
    GIVE_UP = "time is up"


TRANSITIONS: dict[tuple[Phase, Happening], Phase] = {
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.ACCEPTED): Phase.WAIT_EFFECT,
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.SENT_UNACKNOWLEDGED): Phase.WAIT_EFFECT,
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.NOT_NOW): Phase.WAIT_RETRY,
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.REFUSED): Phase.FAILED,
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.EFFECT_SHOWN): Phase.CONFIRMED,
    (Phase.WAIT_ACKNOWLEDGEMENT, Happening.GIVE_UP): Phase.FAILED,
    (Phase.WAIT_EFFECT, Happening.EFFECT_SHOWN): Phase.CONFIRMED,
    (Phase.WAIT_EFFECT, Happening.EFFECT_LATE): Phase.WAIT_RETRY,
    (Phase.WAIT_EFFECT, Happening.GIVE_UP): Phase.FAILED,
    (Phase.WAIT_RETRY, Happening.RETRY_DUE): Phase.WAIT_ACKNOWLEDGEMENT,
    (Phase.WAIT_RETRY, Happening.EFFECT_SHOWN): Phase.CONFIRMED,
    (Phase.WAIT_RETRY, Happening.GIVE_UP): Phase.FAILED,
}

#: Nothing more comes of these.
ENDED = (Phase.CONFIRMED, Phase.FAILED)
