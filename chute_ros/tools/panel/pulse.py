"""The page's sign of life: without it the page turns grey by itself (panel.js)."""

from __future__ import annotations

from nicegui import ui


class Pulse:
    """One element, that nobody sees."""

    def __init__(self) -> None:
        self._count = 0
        self._element = ui.html("", sanitize=False).classes("pulse").props("aria-hidden=true")
        ui.html(
            '<div class="banner tone-quiet"><span class="sign" aria-hidden="true">○</span> NO '
            "CONNECTION TO THE PANEL</div><p>What is below is old.</p>",
            sanitize=False,
        ).classes("lost-note").props('role="alert"')

    def beat(self) -> None:
        """What is shown is of now."""
        self._count += 1
        self._element.set_content(str(self._count))
