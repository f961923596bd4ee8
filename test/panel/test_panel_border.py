"""What may come in from a browser: other pages, other names and frames may not. Pure."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.tools.panel.border import MOST_PAGES, Border, is_ours, own_names, why_not

NAMES = own_names(["Vehicle.example", ""])


def scope(kind="http", method="GET", **headers):
    sent = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return {"type": kind, "method": method, "path": "/fleet", "headers": sent}


@pytest.mark.parametrize(
    ("host", "ours"),
    [
        ("localhost:8080", True),
        ("127.0.0.1:8080", True),
        ("192.168.1.20:8080", True),
        ("[fe80::1]:8080", True),
        ("vehicle.example", True),
        ("VEHICLE.EXAMPLE:8080", True),
        # A name of somebody else that leads here.
        ("evil.example:8080", False),
        ("localhost.evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("", False),
        ("[", False),
    ],
)
def test_the_panel_is_asked_for_by_its_own_names(host, ours):
    assert is_ours(host, NAMES) is ours


@given(st.text())
def test_whatever_a_host_is_it_raises_nothing(host):
    assert is_ours(host, NAMES) in (True, False)


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_page_of_somebody_else_is_refused(kind, method):
    evil = scope(kind, method, host="127.0.0.1:8080", origin="http://evil.example")
    assert why_not(evil, NAMES) == "asked for by a page of somebody else"
    another_port = scope(kind, method, host="127.0.0.1:8080", origin="http://127.0.0.1:9090")
    assert why_not(another_port, NAMES) == "asked for by a page of somebody else"
    nobody = scope(kind, method, host="127.0.0.1:8080", origin="null")
    assert why_not(nobody, NAMES) == "asked for by a page of somebody else"
    ours = scope(kind, method, host="127.0.0.1:8080", origin="http://127.0.0.1:8080")
    assert why_not(ours, NAMES) == ""


def test_a_picture_on_another_page_opens_none_here_and_a_link_does():
    other = {"host": "127.0.0.1:8080", "sec_fetch_site": "cross-site"}
    assert why_not(scope(**other, sec_fetch_mode="no-cors"), NAMES)
    assert why_not(scope(**other, sec_fetch_mode="navigate"), NAMES) == ""


@given(st.text())
def test_whatever_an_origin_is_it_raises_nothing(origin):
    sent = {"type": "http", "method": "GET", "path": "/", "headers": []}
    sent["headers"] = [(b"host", b"localhost"), (b"origin", origin.encode("latin-1", "replace"))]
    assert why_not(sent, NAMES)


def test_more_pages_than_memory_has_room_for_are_refused_and_the_login_is_not():
    (start, _), (login, _) = (
        passed(scope(host="localhost"), MOST_PAGES),
        passed({**scope(host="localhost"), "path": "/login"}, MOST_PAGES),
    )
    assert (start["status"], login["status"]) == (503, 200)
    assert passed(scope(host="localhost"), MOST_PAGES - 1)[0]["status"] == 200


def test_a_page_that_is_just_read_needs_no_origin():
    assert why_not(scope(host="localhost"), NAMES) == ""


def passed(what, pages=0):
    """What an application behind the border sends for this scope."""
    sent = []

    async def application(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": [(b"a", b"b")]})
        await send({"type": "http.response.body", "body": b"page"})

    async def receive():
        return {"type": "websocket.connect"}

    async def send(message):
        sent.append(message)

    # Nothing in it waits.
    with pytest.raises(StopIteration):
        Border(application, NAMES, lambda: pages)(what, receive, send).send(None)
    return sent


def test_what_is_let_in_cannot_be_framed():
    start, body = passed(scope(host="localhost"))
    headers = dict(start["headers"])
    assert headers[b"a"] == b"b"
    assert headers[b"x-frame-options"] == b"DENY"
    assert b"frame-ancestors 'none'" in headers[b"content-security-policy"]
    assert body["body"] == b"page"


def test_what_is_refused_is_told_why_and_reaches_nothing():
    start, body = passed(scope(host="evil.example"))
    assert start["status"] == 403
    assert body["body"] == (b"refused: not a name of this panel: see its parameter host_names\n")
    assert passed(scope("websocket", host="evil.example")) == [
        {"type": "websocket.close", "code": 1008}
    ]
