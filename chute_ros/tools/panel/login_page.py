"""Logging in and out: a form, and a cookie that no script and no other page can use."""

from __future__ import annotations

import time
from html import escape
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, quote

from nicegui import app
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse

from chute_ros.plain_text import plain
from chute_ros.tools.panel.access import SESSION_LASTS, AccessRefusedError, Operator

if TYPE_CHECKING:
    from chute_ros.tools.panel.node import PanelNode

COOKIE = "chute_panel"
#: Of a form that is sent, bytes.
_LONGEST = 8192
_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>chute_ros: log in</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>
body {{ font: 17px system-ui, sans-serif; max-width: 22rem; margin: 3rem auto; padding: 0 1rem;
  color-scheme: light dark; }}
label {{ display: block; margin: 1rem 0 .2rem; }}
input, button {{ font: inherit; width: 100%; padding: .6rem; box-sizing: border-box; }}
button {{ margin-top: 1.4rem; }} .wrong {{ border-left: .4rem solid #8f1220; padding-left: .6rem; }}
</style></head><body><h1>Log in</h1><p>Who has logged in gives orders to vehicles. Your name goes into
their records.</p>{told}<form method="post" action="/login?next={next}">
<label for="name">Your name</label><input id="name" name="name" maxlength="40" required
  autocomplete="username" value="{name}">
<label for="password">Password</label><input id="password" name="password" type="password" required
  autocomplete="current-password"><button>Log in</button></form></body></html>"""


def person_of(node: PanelNode, request: Request) -> Operator | None:
    """Who asks; None: nobody who has logged in."""
    return node.access.person(token_of(request), address_of(request), time.monotonic())


def token_of(request: Request) -> str:
    """The session's; empty: none."""
    return request.cookies.get(cookie_name(request.url.scheme == "https"), "")


def address_of(request: Request) -> str:
    """Whence it is asked."""
    return request.client.host if request.client else "nowhere"


def cookie_name(secure: bool) -> str:
    """Browsers let nobody but this page set one of that prefix."""
    return f"__Host-{COOKIE}" if secure else COOKIE


def register(node: PanelNode, secure: bool) -> None:
    """Add its pages."""

    @app.get("/login")
    def show(request: Request) -> Any:
        return HTMLResponse(_form(_next(request)))

    @app.post("/login")
    async def log_in(request: Request) -> Any:
        fields = await _fields(request)
        name, password = plain(fields.get("name", "")), fields.get("password", "")
        address = address_of(request)
        try:
            token = node.access.log_in(name, password, address, time.monotonic())
        except AccessRefusedError as error:
            node.get_logger().warning(f"login of {name[:40]!r} from {address}: {error}")
            return HTMLResponse(_form(_next(request), str(error), name), status_code=403)
        node.access.log_out(token_of(request))
        node.get_logger().info(f"{name[:40]!r} logged in from {address}")
        answer = RedirectResponse(_next(request), status_code=303)
        answer.set_cookie(
            cookie_name(secure),
            token,
            max_age=int(SESSION_LASTS),
            secure=secure,
            httponly=True,
            samesite="strict",
        )
        return answer

    @app.post("/logout")
    async def log_out(request: Request) -> Any:
        node.access.log_out(token_of(request))
        answer = RedirectResponse(_next(request), status_code=303)
        answer.delete_cookie(cookie_name(secure), secure=secure)
        return answer


async def _fields(request: Request) -> dict[str, str]:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > _LONGEST:
            return {}
    text = body.decode("utf-8", errors="replace")
    try:
        given = parse_qs(text, keep_blank_values=True, max_num_fields=10)
    except ValueError:
        return {}
    return {name: values[0] for name, values in given.items()}


def _next(request: Request) -> str:
    """Where to go on: a page of ours, and of nobody else."""
    wanted = request.query_params.get("next", "/")
    inside = wanted.startswith("/") and not wanted.startswith(("//", "/\\"))
    return quote(wanted, safe="/") if inside else "/"


def _form(onward: str, wrong: str = "", name: str = "") -> str:
    told = f'<p class="wrong" role="alert">{escape(wrong)}</p>' if wrong else ""
    return _PAGE.format(told=told, next=escape(onward), name=escape(name[:40]))
