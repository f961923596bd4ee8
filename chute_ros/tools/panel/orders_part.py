"""The buttons that order something of a vehicle: held to confirm, and each answer below them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui
from starlette.requests import Request

from chute_ros.plain_text import plain
from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.chute import order as orders
from chute_ros.tools.chute.options import ANSWER
from chute_ros.tools.chute.order import Order, answer_text, not_answered
from chute_ros.tools.panel.access import Operator
from chute_ros.tools.panel.login_page import person_of
from chute_ros.tools.panel.pulse import Pulse

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

_MOST_ANSWERS = 6
#: Who holds a button looks at a page that is no older, s.
_SEEN_WITHIN = 2.0
_LONGEST_REASON = 200


class OrdersPart:
    """Empty where orders are not allowed. request: for the page; pulse: of it."""

    def __init__(self, node: PanelNode, namespace: str, request: Request, pulse: Pulse) -> None:
        self._node, self._namespace, self._request = node, namespace, request
        self._pulse = pulse
        self._text = ""
        #: Name of an order -> the beat that whoever gave it last had seen. Who holds the button
        #: once more sees a later one (panel.js); a burst that was obeyed slowly does not.
        self._given: dict[str, int] = {}
        if not node.settings.allow_commands:
            return
        with ui.element("section").classes("card orders"):
            self._note = ui.label("").classes("note")
            self._unreached = ui.label("").classes("note is-bad").props('role="alert"')
            self._all = ui.element("div")
            with self._all:
                with ui.element("div").classes("buttons"):
                    self._button("DEPLOY", "act", orders.deploy)
                    self._button("KILL motors", "bad", orders.kill)
                    self._button("Arm parachutes", "live", lambda _: orders.arm(True))
                    self._button("Disarm", "warn", lambda _: orders.arm(False))
                with ui.element("details"):
                    ui.html("more orders", sanitize=False, tag="summary")
                    with ui.element("div").classes("buttons"):
                        self._button("Reset", "quiet", lambda _: orders.reset())
                        for mode in Mode:
                            self._button(f"Mode {mode.name}", "quiet", partial(orders.mode, mode))
                reason = ui.element("input").props(
                    f'placeholder="reason, for the record" maxlength="{_LONGEST_REASON}" '
                    'aria-label="reason, for the record"'
                )
                reason.on("input", self._take_reason, js_handler="(e) => emit(e.target.value)")
            self._answers = ui.element("div").classes("answers").props('aria-live="polite"')
        self.refresh()

    def refresh(self, unreached: str = "") -> None:
        """Whether the session still lasts. unreached: why no parachute can be reached, if so."""
        if not self._node.settings.allow_commands:
            return
        person = self._person()
        self._note.set_text(
            f"Hold a button for 1.5 s to give the order, as {person.name}."
            if person
            else "Log in to give orders."
        )
        self._all.set_visibility(person is not None)
        self._unreached.set_text(f"{unreached}: DEPLOY: {orders.STOPS_ALL_THE_SAME}.")
        self._unreached.set_visibility(person is not None and bool(unreached))

    def _button(self, text: str, tone: str, make: Callable[[str], Order]) -> None:
        async def held(event: Any) -> None:
            # Given before a connection was cut, it would be obeyed when nobody expects it.
            if self._pulse.age(event.args) > _SEEN_WITHIN:
                self._tell(f"{text}: NOT SENT: the page was not connected; hold it again", "bad")
                return
            await self._give(make, event.args)

        button = ui.element("button").classes(f"hold tone-{tone}")
        with button:
            ui.html(f"<span>{text}</span><i></i>", sanitize=False)
        # Sent by panel.js once it was held for long enough.
        button.on("held", held, js_handler="(e) => emit(e.detail)")

    def _take_reason(self, event: Any) -> None:
        self._text = str(event.args)[:_LONGEST_REASON]

    def _person(self) -> Operator | None:
        return person_of(self._node, self._request)

    async def _give(self, make: Callable[[str], Order], beat: int) -> None:
        person = self._person()
        if person is None:
            self._tell("NOT SENT: log in again", "bad")
            return
        reason = plain(self._text).strip() or orders.NO_REASON
        order = make(f"{person.text}: {reason}")
        if beat <= self._given.get(order.name, 0):
            self._tell(f"{order.name}: NOT SENT: the same was given just now", "bad")
            return
        self._given[order.name] = beat
        line = self._tell(f"{order.name}: sent, no answer yet", "quiet")
        future = asyncio.wrap_future(self._node.order(self._namespace, order, person))
        await asyncio.wait({future}, timeout=ANSWER)
        if not future.done():
            line(not_answered(order, f"within {ANSWER:g} s"), "bad")
        # It may still come.
        answer = await future
        line(answer_text(order, answer), "good" if answer.success else "bad")

    def _tell(self, text: str, tone: str) -> Callable[[str, str], None]:
        at = time.strftime("%H:%M:%S")
        with self._answers:
            label = ui.label(f"{at} {text}").classes(f"is-{tone}")
        label.move(target_index=0)
        children = self._answers.default_slot.children
        while len(children) > _MOST_ANSWERS:
            children[-1].delete()

        def again(text: str, tone: str) -> None:
            label.set_text(f"{at} {text}")
            label.classes(replace=f"is-{tone}")

        return again
