"""What can be done to a simulated vehicle: a button each, what will happen, what came of it."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from nicegui import ui

from chute_ros.sim.bench_actions import ACTIONS
from chute_ros.tools.chute.order import Order, answer_text, not_answered

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

#: What a simulated vehicle offers to be done to it is a service of this folder.
BENCH = "sim/"
_EFFECTS = {one.name: one for one in ACTIONS}
#: Taking off takes its time, s.
_LONGEST = 60.0


class BenchPart:
    """Of this vehicle: those of its actions that are offered."""

    def __init__(self, node: PanelNode, namespace: str) -> None:
        self._node, self._namespace = node, namespace
        self._offered: list[str] | None = None
        with ui.element("section").classes("card bench"):
            ui.html("<h2>What happens to the simulated vehicle</h2>", sanitize=False)
            self._rows = ui.element("div").classes("actions")

    def refresh(self) -> None:
        """Look what is offered."""
        there = self._node.offered(self._namespace, BENCH)
        offered = [name for name in _EFFECTS if name in there]
        if offered == self._offered:
            return
        self._offered = offered
        self._rows.clear()
        with self._rows:
            for name in offered:
                self._row(name)
            if not offered:
                ui.label("No simulated vehicle offers anything here (services sim/...).")

    def _row(self, name: str) -> None:
        action = _EFFECTS[name]
        with ui.element("div").classes("action"):
            with ui.element("button") as button:
                ui.label(action.title)
            ui.label(action.effect).classes("effect")
            # Beside the button that was pressed: on a phone the next is a screen away.
            answer = ui.label("").classes("answers").props('aria-live="polite"')

        async def pressed() -> None:
            await self._do(name, answer)

        button.on("click", pressed, args=[])

    async def _do(self, name: str, told: Any) -> None:
        order = Order(_EFFECTS[name].title, "Trigger", f"{BENCH}{name}")
        told.set_text(f"{order.name}: ...")
        future: Any = asyncio.wrap_future(self._node.order(self._namespace, order, None))
        try:
            answer = await asyncio.wait_for(future, _LONGEST)
        except asyncio.TimeoutError:
            told.set_text(not_answered(order, f"within {_LONGEST:g} s"))
            return
        told.set_text(answer_text(order, answer))
