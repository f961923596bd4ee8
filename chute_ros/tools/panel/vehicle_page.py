"""The page of one vehicle."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from nicegui import ui
from starlette.requests import Request

from chute_ros.tools.panel.bench_part import BenchPart
from chute_ros.tools.panel.chart import Curves
from chute_ros.tools.panel.login_page import person_of
from chute_ros.tools.panel.orders_part import OrdersPart
from chute_ros.tools.panel.pulse import Pulse

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

_EVERY = 0.25  # s
#: A vehicle that is not found is looked for so often, s.
_LOOKS = 1.0
#: Of so many turns one draws the curves, and looks what the bench offers.
_SLOWLY = 4
_NAMESPACE = re.compile(r"/|(/[A-Za-z_][A-Za-z0-9_]*)+")
#: Parts of the page, in their order on a phone; wide screens have two columns.
_LEFT = ("blocks", "parachutes", "vehicle")
_RIGHT = ("rocket", "links", "decisions", "rules", "diagnostics")

#: What stands beside the bench as well.
_BESIDE_BENCH = ("vehicle", "links")


def register(node: PanelNode) -> None:
    """Add its pages."""

    @ui.page("/vehicle/{name:path}")
    def show(name: str, request: Request) -> None:
        namespace = f"/{name.strip('/')}"
        if not _NAMESPACE.fullmatch(namespace) or not node.is_there(namespace):
            _none(node, namespace)
            return
        watched = node.look(namespace)
        ui.context.client.on_delete(lambda: node.leave(namespace))
        ui.page_title(f"{namespace}: chute_ros")
        pulse = Pulse()
        _head(node, namespace, request)
        shown: list[tuple[str, Any]] = [("banner", _part("banner").props('role="status"'))]
        # Before all that scrolls: an operator who must act must not search.
        orders = OrdersPart(node, namespace, request, pulse)
        bench: list[BenchPart] = []
        curves: list[Curves] = []

        def field() -> None:
            with ui.element("div").classes("columns"):
                with ui.element("div"):
                    shown.extend((one, _part(one)) for one in _LEFT)
                with ui.element("div"):
                    curves.append(Curves())
                    shown.extend((one, _part(one)) for one in _RIGHT)

        def try_out() -> None:
            with ui.element("div").classes("columns"):
                bench.append(BenchPart(node, namespace))
                # What a button does to it is seen beside it.
                with ui.element("div"):
                    shown.extend((one, _part(one)) for one in _BESIDE_BENCH)

        if node.settings.bench:
            _tabs(Field=field, Bench=try_out)
        else:
            field()
        turns = 0

        def refresh() -> None:
            nonlocal turns
            parts = watched.parts()
            for name, element in shown:
                element.set_content(parts.get(name, ""))
            orders.refresh(parts.get("unreached", ""))
            if turns % _SLOWLY == 0:
                for drawn in curves:
                    drawn.draw(*watched.drawn())
                for one in bench:
                    one.refresh()
            turns += 1
            # Last: what fails before it must not seem to be of now.
            pulse.beat()

        ui.timer(_EVERY, refresh)


def _head(node: PanelNode, namespace: str, request: Request) -> None:
    with ui.element("header").classes("top"):
        ui.html(f'<a href="/fleet">all vehicles</a> <b>{namespace}</b>', sanitize=False)
        if not node.access.is_possible:
            return
        onward = quote(f"/vehicle{namespace}")
        if person := person_of(node, request):
            with ui.element("form").props(f'method="post" action="/logout?next={onward}"'):
                ui.label(person.name)
                ui.element("button").add_slot("default", "log out")
        else:
            ui.html(f'<a href="/login?next={onward}">log in</a>', sanitize=False)


def _tabs(**pages: Callable[[], None]) -> None:
    """A tab each: the first is open, and each stays as it was while another one is."""
    with ui.tabs().props("no-caps align=left") as tabs:
        for name in pages:
            ui.tab(name)
    with ui.tab_panels(tabs, value=next(iter(pages)), animated=False, keep_alive=True):
        for name, fill in pages.items():
            with ui.tab_panel(name):
                fill()


def _part(name: str) -> Any:
    return ui.html("", sanitize=False).classes(f"part-{name}")


def _none(node: PanelNode, namespace: str) -> None:
    found = ", ".join(node.vehicles()) or "none"
    ui.label(f"No supervisor is found in {namespace[:200]}. Vehicles found: {found}.")
    ui.link("all vehicles", "/fleet")

    def look() -> None:
        if _NAMESPACE.fullmatch(namespace) and node.is_there(namespace):
            ui.navigate.reload()

    ui.timer(_LOOKS, look)
