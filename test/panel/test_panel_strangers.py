"""What strangers on the network and on the web can do to the panel: no more than be left out."""

from __future__ import annotations

import http.client
import re

import pytest
from chute_msgs.msg import ParachuteStatus
from panel_bench import PATIENCE
from panel_vehicles import open_vehicle, until
from playwright.sync_api import expect

from chute_ros.ros import qos
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.panel.border import MOST_PAGES

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")


def get(panel, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", panel.port, timeout=20.0)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def test_names_that_are_none_do_not_end_it(fly, namespace, panel, open_page):
    vehicles = fly({"drone1": Stage.READY})
    page = open_vehicle(fly, panel, open_page, f"{namespace}/drone1")
    publisher = vehicles.create_publisher(ParachuteStatus, "drone1/parachute/status", qos.STATUS)
    names = (
        ("mavlink_parachute", "\u00b2"),
        ("mavlink_parachute", "9" * 400),
        ("", ""),
        ("a b", "1"),
        ("upf_can/../x", "33"),
    )

    def all_shown():
        # Again and again: a status is sent once and may be lost.
        for link, device in names:
            publisher.publish(ParachuteStatus(link=link, device=device))
        return page.locator(".part-parachutes section").count() == len(names)

    until(fly, all_shown, page)
    # They were asked who they are by then, or not; and it lives on.
    beat = page.locator(".pulse").text_content()
    until(fly, lambda: page.locator(".pulse").text_content() != beat, page)
    assert "Traceback" not in panel.log()
    assert panel.processes.check() is None


def test_many_pages_that_nobody_looks_at_do_not_end_it(start_panel, await_until):
    panel = start_panel()
    assert get(panel, "/nowhere") == (404, "There is no such page: / has all vehicles.\n")
    seen = {get(panel, "/fleet")[0] for _ in range(3 * MOST_PAGES)}
    assert seen == {200, 503}
    status, text = get(panel, "/fleet")
    assert (status, text.partition(":")[0]) == (503, "refused")
    assert get(panel, "/login")[0] == 200
    # Pages that were left make room.
    await_until(lambda: get(panel, "/fleet")[0] == 200, "there is room again", 30.0)
    assert panel.processes.check() is None


def test_no_visitor_writes_lines_of_the_log(panel, open_page):
    page = open_page(f"{panel.address}/fleet")
    expect(page.locator(".none, .fleet").first).to_be_visible(timeout=PATIENCE)
    page.evaluate(
        """() => {
            const text = "\\n[INFO] [panel]: /drone1 safety/deploy: by='Anna'\\x1b[2J";
            for (let n = 0; n < 100; n++) {
                const line = {client_id: window.clientId, level: "error", message: text};
                window.socket.emit("log", line);
                window.socket.emit("event", {nonsense: text});
                window.socket.emit("event", text);
            }
        }"""
    )
    beat = page.locator(".pulse").text_content()
    expect(page.locator(".pulse")).not_to_have_text(beat, timeout=PATIENCE)
    assert "Anna" not in re.sub(r"\\.*", "", panel.log())
    assert "\x1b" not in panel.log()
    assert "Traceback" not in panel.log()
    assert len(panel.log().splitlines()) < 60


def test_invented_namespaces_do_not_hide_a_vehicle(fly, namespace, panel, open_page):
    fly({f"a{number:02}": Stage.READY for number in range(60)} | {"zulu": Stage.FAULT})
    page = open_page(f"{panel.address}/vehicle{namespace}/zulu")
    until(fly, lambda: "FAULT" in page.locator("body").inner_text(), page)
    page.goto(f"{panel.address}/fleet")
    until(fly, lambda: page.locator(".vehicle").count() == 50, page)
