"""What may come in from a browser, and what a browser is told about the page.

A page of somebody else that is open in the operator's browser must neither order nor read
anything: its requests bear its own origin, and a name of its own that it lets lead to this
computer is none of ours.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Any]]
Send = Callable[[Any], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

#: No other page may frame it, to have its buttons pressed.
_HEADERS = (
    (b"x-frame-options", b"DENY"),
    (b"content-security-policy", b"frame-ancestors 'none'; form-action 'self'; base-uri 'self'"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
)


def own_names(given: Iterable[str]) -> frozenset[str]:
    """Under which names the panel may be asked for. given: by the user."""
    own = socket.gethostname().lower()
    names = {"localhost", own, f"{own.partition('.')[0]}.local", *map(str.lower, given)}
    return frozenset(name for name in names if name)


def is_ours(host: str, names: frozenset[str]) -> bool:
    """host: as a browser sends it, with a port or without."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    try:
        ipaddress.ip_address(name.partition("%")[0])
    except ValueError:
        return name in names
    return True


def why_not(scope: Scope, names: frozenset[str]) -> str:
    """Why a request is not let in; empty: it is."""
    headers = {key.lower(): value.decode("latin-1") for key, value in scope["headers"]}
    host = headers.get(b"host", "")
    if not is_ours(host, names):
        return "not a name of this panel: see its parameter host_names"
    # Browsers send the origin with all that is no plain reading; what is no browser need not.
    origin = headers.get(b"origin")
    if origin is not None and _place_of(origin) != host.lower():
        return "asked for by a page of somebody else"
    # A picture on another page would open pages here; a link on it is followed by a person.
    follows = headers.get(b"sec-fetch-mode") == "navigate"
    if headers.get(b"sec-fetch-site") == "cross-site" and not follows:
        return "asked for by a page of somebody else"
    return ""


def _place_of(origin: str) -> str:
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


#: Each takes memory, also one that nobody looks at; the login is always there.
MOST_PAGES = 60
_ASSETS = ("/_nicegui", "/favicon", "/login", "/logout")


class Border:
    """An ASGI application in front of another. names: own_names; pages: how many are open."""

    def __init__(self, app: App, names: frozenset[str], pages: Callable[[], int]) -> None:
        self._app, self._names, self._pages = app, names, pages

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        if why := why_not(scope, self._names):
            await _refuse(scope, receive, send, 403, why)
            return
        is_page = scope["type"] == "http" and not scope["path"].startswith(_ASSETS)
        if is_page and scope["method"] == "GET" and self._pages() >= MOST_PAGES:
            why = f"{MOST_PAGES} pages are open, or were a moment ago: close some, or wait"
            await _refuse(scope, receive, send, 503, why)
            return

        async def sending(message: Any) -> None:
            if message["type"] == "http.response.start":
                kept = ((b"cache-control", b"no-store"),) if is_page else ()
                message["headers"] = [*message.get("headers", ()), *_HEADERS, *kept]
            await send(message)

        await self._app(scope, receive, sending)


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, why: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    head = [(b"content-type", b"text/plain; charset=utf-8"), *_HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": head})
    await send({"type": "http.response.body", "body": f"refused: {why}\n".encode()})
