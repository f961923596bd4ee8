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


def register(node: PanelNode) -> None:
    """Add its pages."""

    @ui.page("/")
    def start() -> Any:
        there = node.vehicles()
        if len(there) == 1:
            return RedirectResponse(link_to(there[0]))
        return show()

    @ui.page("/fleet")
    def show() -> None:
        node.look_at_all()
        ui.context.client.on_delete(node.leave_all)
        pulse = Pulse()
        cards = ui.html("", sanitize=False).classes("all")

        def refresh() -> None:
            pulse.beat()
            cards.set_content(fleet(node.fleet(), time.monotonic()))

        ui.timer(_EVERY, refresh)
