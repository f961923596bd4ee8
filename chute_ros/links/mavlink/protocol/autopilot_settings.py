"""The autopilot's own parameters that decide how a kill and a flight block go.

Read by name with the parameter protocol, one at a time: a lost request is sent again, what is not
answered although others are is not there, and all are read again after a restart and every so
often. A value that somebody sets meanwhile is sent to everybody (PARAM_VALUE) and taken over.

Sources: MAVLink developer guide, "Parameter protocol" (PX4 puts the bytes of an integer into the
float field, ArduPilot its value); names and meanings: PX4 src/modules/commander, mc_pos_control
and lib/circuit_breaker; ArduPilot AP_Arming, AP_AdvancedFailsafe, AP_Parachute and ArduPlane.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.protocol.mavlink.dialect import dialect

#: What is read of each.
NAMES: Mapping[Firmware, tuple[str, ...]] = {
    Firmware.PX4: (
        "COM_ARM_AUTH_REQ",
        "COM_ARM_AUTH_ID",
        "COM_ARM_AUTH_MET",
        "COM_SPOOLUP_TIME",
        "MPC_TKO_RAMP_T",
        "CBRK_FLIGHTTERM",
        "COM_PARACHUTE",
    ),
    Firmware.ARDUPILOT: (
        "ARMING_REQUIRE",
        "AFS_ENABLE",
        "AFS_TERM_ACTION",
        "AFS_TERM_PIN",
        "CHUTE_ENABLED",
        "HOME_RESET_ALT",
    ),
    Firmware.OTHER: (),
}
#: Beginnings of the names of what an autopilot has as a whole, or not at all.
_GROUPS = ("AFS_",)
#: From one request to the next, and to its repetition, s.
_PACE, _ANSWER_TIME = 0.2, 1.0
_TRIES = 3
#: All are read again after so long, s.
READ_AGAIN = 60.0
#: How an integer lies in the bytes of a float (PX4).
_BYTEWISE = {
    dialect.MAV_PARAM_TYPE_UINT8: "<B3x",
    dialect.MAV_PARAM_TYPE_INT8: "<b3x",
    dialect.MAV_PARAM_TYPE_UINT16: "<H2x",
    dialect.MAV_PARAM_TYPE_INT16: "<h2x",
    dialect.MAV_PARAM_TYPE_UINT32: "<I",
    dialect.MAV_PARAM_TYPE_INT32: "<i",
}


class AutopilotSettings:
    """Reads the parameters of one autopilot and keeps what it answers."""

    def __init__(self) -> None:
        self.firmware = Firmware.OTHER
        self._values: dict[str, float] = {}
        #: The autopilot says so; or it did not answer, although it answered others.
        self._denied: set[str] = set()
        self._absent: set[str] = set()
        #: Asked for in vain.
        self._unanswered: set[str] = set()
        #: Still to be read in this round, the next one first.
        self._left: list[str] = []
        self._tries = 0
        self._asked = self._round_began = -math.inf

    def begin(self, firmware: Firmware, now: float) -> None:
        """The autopilot is heard, or heard again, or started again: read all of them. What was
        read before holds until then."""
        if firmware is not self.firmware:
            self._values.clear()
            self._denied.clear()
            self._absent.clear()
            self._unanswered.clear()
        self.firmware = firmware
        self._left, self._tries, self._round_began = list(NAMES[firmware]), 0, now

    def due(self, now: float) -> str:
        """The parameter to ask for now; empty: none."""
        if not self._left and now >= self._round_began + READ_AGAIN:
            self.begin(self.firmware, now)
        if self._left and self._tries >= _TRIES and now >= self._asked + _ANSWER_TIME:
            self._not_answered()
        wait = _ANSWER_TIME if self._tries else _PACE
        if not self._left or now < self._asked + wait:
            return ""
        self._asked, self._tries = now, self._tries + 1
        return self._left[0]

    def heard(self, message: Any) -> bool:
        """A PARAM_VALUE or PARAM_ERROR of the autopilot. Returns whether we have asked for it."""
        name = message.param_id
        if name not in NAMES[self.firmware]:
            return False
        asked = bool(self._tries) and name == self._left[0]
        if message.get_type() == "PARAM_ERROR":
            if message.error == dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST:
                self._values.pop(name, None)
                self._denied.add(name)
                self._answered(name)
            return asked
        value = self._decoded(message)
        if math.isfinite(value):
            self._values[name] = value
            self._denied.discard(name)
            self._absent.discard(name)
            self._answered(name)
        return asked

    def get(self, name: str) -> float | None:
        """Its value; None: not read, or not there."""
        return self._values.get(name)

    def absent(self, name: str) -> bool:
        """This autopilot has no such parameter. Of a group it has all or none: where one of them
        is answered, another one's answers were lost."""
        group = name.partition("_")[0] if name.startswith(_GROUPS) else name
        some = any(one.startswith(group) for one in self._values)
        return name in self._denied or (name in self._absent and not some)

    def unread(self, *names: str) -> tuple[str, ...]:
        """Those of them that this firmware has and that were neither answered nor asked for in
        vain, ever."""
        known = {*self._values, *self._denied, *self._absent, *self._unanswered}
        return tuple(name for name in names if name in NAMES[self.firmware] and name not in known)

    @property
    def answers(self) -> bool:
        """The autopilot has answered at least once."""
        return bool(self._values or self._denied or self._absent)

    @property
    def complete(self) -> bool:
        """All of them were read, or asked for in vain."""
        return not self._left

    @property
    def silent(self) -> bool:
        """It has parameters that we know of, was asked for all of them, and answered nothing."""
        return bool(NAMES[self.firmware]) and not self._left and not self.answers

    def texts(self) -> dict[str, str]:
        """Each parameter with its value, in words."""
        return {name: self.text(name) for name in NAMES[self.firmware]}

    def text(self, name: str) -> str:
        """The value of one, in words."""
        if name in self._values:
            return f"{self._values[name]:g}"
        if self.absent(name):
            return "not there"
        return "not answered" if self.silent or name in self._absent else "not read yet"

    def _decoded(self, message: Any) -> float:
        form = _BYTEWISE.get(message.param_type)
        if self.firmware is not Firmware.PX4 or form is None:
            return float(message.param_value)
        raw = struct.pack("<f", message.param_value)
        return float(struct.unpack(form, raw)[0])

    def _answered(self, name: str) -> None:
        self._unanswered.discard(name)
        if name in self._left:
            if name == self._left[0]:
                self._tries = 0
            self._left.remove(name)
        self._settle()

    def _not_answered(self) -> None:
        self._unanswered.add(self._left.pop(0))
        self._tries = 0
        self._settle()

    def _settle(self) -> None:
        # Where nothing is answered, nothing is known to be missing.
        if self.answers:
            self._absent |= self._unanswered - set(self._values)
            self._unanswered.clear()
