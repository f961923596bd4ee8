"""The panel as a process: what it refuses to start with, and what it lets in."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from urllib.parse import urlencode

import pytest
from panel_bench import PASSWORD

from chute_ros.errors import ParameterError
from chute_ros.tools.panel.parameters import PanelSettings
from chute_ros.tools.panel.password import password_from
from chute_ros.tools.processes import ros_arguments

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")


def started_with(**parameters):
    """(exit code, what it said) of a panel that does not start."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTEST_CURRENT_TEST"}
    done = subprocess.run(
        [sys.executable, "-m", "chute_ros.tools.panel", *ros_arguments("/", **parameters)],
        capture_output=True,
        text=True,
        timeout=60.0,
        env=environment,
        check=False,
    )
    return done.returncode, done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"allow_commands": True},
            (
                "parameter allow_commands is True and password_file is '': need a password: set "
                "password_file, or leave allow_commands false"
            ),
        ),
        (
            {"certificate_file": "a.pem"},
            "parameter certificate_file is 'a.pem' and key_file is '': need both or neither",
        ),
    ],
)
def test_orders_need_a_password_and_https_both_files(settings, told):
    with pytest.raises(ParameterError) as refused:
        PanelSettings(**settings)
    assert str(refused.value) == told


@pytest.mark.parametrize(
    ("text", "mode", "told"),
    [
        (PASSWORD, 0o644, "may be read by others: chmod 600"),
        ("short", 0o600, "has no password: need one line of 10 characters or more"),
        ("two lines\nof a text", 0o600, "has no password: need one line of 10 characters or more"),
        (None, 0, "No such file or directory"),
    ],
)
def test_a_password_file_that_is_none(tmp_path, text, mode, told):
    file = tmp_path / "password"
    if text is not None:
        file.write_text(f"{text}\n")
        file.chmod(mode)
    with pytest.raises(ParameterError, match=told) as refused:
        password_from(str(file))
    assert str(refused.value).startswith(f"parameter password_file: {file}")


def test_without_its_password_file_it_does_not_start(ros, tmp_path):
    file = tmp_path / "password"
    code, said = started_with(allow_commands="true", password_file=file)
    assert code == 2
    assert said.startswith(f"panel: parameter password_file: {file}: ")


def test_without_nicegui_it_says_what_to_install(ros, tmp_path, monkeypatch):
    # Given a computer on which it cannot be imported,
    (tmp_path / "nicegui.py").write_text("raise ModuleNotFoundError('none', name='nicegui')\n")
    paths = f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"
    monkeypatch.setenv("PYTHONPATH", paths)
    assert started_with() == (
        1, "nicegui is not installed: `pip install -r requirements/extra.in` brings it"
    )  # fmt: skip


def test_a_port_that_somebody_else_has(ros):
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        port = one.getsockname()[1]
        code, said = started_with(port=port)
    assert code == 2
    assert said == (
        f"panel: parameters host and port are 127.0.0.1 and {port}: Address already in use; name "
        "others, or end what listens there"
    )


def test_https_without_its_files_ends_with_a_word(ros, tmp_path):
    code, said = started_with(certificate_file=tmp_path / "a.pem", key_file=tmp_path / "b.pem")
    assert code == 2
    assert said == (
        "panel: parameters certificate_file and key_file: [Errno 2] No such file or directory "
        f"({tmp_path}/a.pem, {tmp_path}/b.pem)"
    )


def test_https_with_a_certificate_that_is_none_ends_with_a_word(ros, tmp_path):
    for name in ("a.pem", "b.pem"):
        (tmp_path / name).write_text("this is no certificate\n")
    code, said = started_with(certificate_file=tmp_path / "a.pem", key_file=tmp_path / "b.pem")
    assert code == 2
    assert said.startswith("panel: parameters certificate_file and key_file: ")


def asked(panel, method, path, body="", whence="127.0.0.1", **headers):
    """(status, headers, text) of one request from this address."""
    connection = http.client.HTTPConnection("127.0.0.1", panel.port, 20.0, (whence, 0))
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    if body:
        sent["content-type"] = "application/x-www-form-urlencoded"
    try:
        connection.request(method, path, body, sent)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()
    finally:
        connection.close()


def logged_in(panel, password=PASSWORD, path="/login", **headers):
    body = urlencode({"name": "Anna", "password": password})
    return asked(panel, "POST", path, body, **headers)


def test_a_login_gives_a_cookie_that_no_script_and_no_other_page_can_use(panel):
    status, headers, _ = logged_in(panel, path="/login?next=/vehicle/drone1")
    assert (status, headers["location"]) == (303, "/vehicle/drone1")
    cookie = headers["set-cookie"]
    assert re.match(r"chute_panel=[\w-]{43};", cookie)
    for part in ("HttpOnly", "SameSite=strict", "Path=/"):
        assert part in cookie
    # One that ends its session has none any more.
    given = cookie.partition(";")[0]
    status, headers, _ = asked(panel, "POST", "/logout", cookie=given)
    assert status == 303
    assert 'chute_panel=""' in headers["set-cookie"]


def test_a_login_leads_to_no_other_page(panel):
    for onward in ("//evil.example/", "/\\evil.example", "https://evil.example/", "javascript:x"):
        status, headers, _ = logged_in(panel, path=f"/login?{urlencode({'next': onward})}")
        assert (status, headers["location"]) == (303, "/"), onward


def test_guessing_is_told_and_kept_waiting(panel):
    whence = "127.0.0.2"
    for _ in range(3):
        status, _, text = logged_in(panel, "guess", whence=whence)
        assert status == 403
        assert "wrong password" in text
    status, headers, text = logged_in(panel, whence=whence)
    assert status == 403
    assert "too many wrong passwords: try again in" in text
    assert "set-cookie" not in headers
    assert f"login of 'Anna' from {whence}: wrong password" in panel.log()
    assert "guess" not in panel.log()


def test_another_page_and_another_name_are_refused(panel):
    for headers in ({"origin": "http://evil.example"}, {"host": "evil.example"}):
        for method, path in (("POST", "/login"), ("GET", "/"), ("GET", "/_nicegui_ws/socket.io/")):
            status, _, text = asked(panel, method, path, **headers)
            assert (status, text.partition(":")[0]) == (403, "refused")


def test_a_websocket_of_another_page_is_refused(panel):
    with socket.create_connection(("127.0.0.1", panel.port), 20.0) as wire:
        wire.sendall(
            b"GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n"
            b"Host: 127.0.0.1:%d\r\nOrigin: http://evil.example\r\nUpgrade: websocket\r\n"
            b"Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            b"Sec-WebSocket-Version: 13\r\n\r\n" % panel.port
        )
        assert b" 403 " in wire.recv(4096).partition(b"\r\n")[0]


def test_garbage_harms_nobody(panel):
    assert asked(panel, "POST", "/login", "x" * 100_000)[0] == 403
    assert asked(panel, "POST", "/login", "&" * 5000)[0] == 403
    assert asked(panel, "POST", "/login", "name=%ff%00&password=%ff")[0] == 403
    for path in ("/vehicle/../../etc/passwd", "/vehicle/%00", "/vehicle/<script>", "/nowhere"):
        status, _, text = asked(panel, "GET", path.replace("<", "%3C"))
        assert status in (200, 404)
        assert "<script>alert" not in text
    with socket.create_connection(("127.0.0.1", panel.port), 20.0) as wire:
        wire.sendall(b"\x00\xff" * 500 + b"\r\n\r\n")
        assert b"400" in wire.recv(4096)
    assert asked(panel, "GET", "/fleet")[0] == 200
    assert "Traceback" not in panel.log()


def test_ctrl_c_ends_it_at_once_with_pages_open(start_panel, open_page):
    panel = start_panel()
    page = open_page(f"{panel.address}/fleet")
    page.locator(".fleet, .none").first.wait_for()
    panel.processes.send_signal("panel", signal.SIGINT)
    panel.processes.end()
    assert "Traceback" not in panel.log()
