"""The pages / and /fleet: all vehicles, the worst first."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from nicegui import ui
from starlette.responses import RedirectResponse

from chute_ros.tools.panel.fleet import fleet, link_to
from chute_ros.tools.panel.pulse import Pulse

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

_EVERY = 0.5  # s
#: One vehicle that was found is the only one if no other is in so many turns.
_ALONE = 4


def register(node: PanelNode) -> None:
    """Add its pages."""

    @ui.page("/")
    def start() -> Any:
        there = node.vehicles()
        if len(there) == 1:
            return RedirectResponse(link_to(there[0]))
        return _show(node, goes_on=not there)

    @ui.page("/fleet")
    def show() -> None:
        _show(node, goes_on=False)


def _show(node: PanelNode, goes_on: bool) -> None:
    """goes_on: to the first vehicle, if it is the only one."""
    node.look_at_all()
    ui.context.client.on_delete(node.leave_all)
    pulse = Pulse()
    cards = ui.html("", sanitize=False).classes("all")
    alone = 0

    def refresh() -> None:
        nonlocal alone
        those = node.fleet()
        cards.set_content(fleet(those, time.monotonic()))
        alone = alone + 1 if len(those) == 1 else 0
        if goes_on and alone == _ALONE:
            ui.navigate.to(link_to(those[0][0]))
        # Last: what fails before it must not seem to be of now.
        pulse.beat()

    ui.timer(_EVERY, refresh)
