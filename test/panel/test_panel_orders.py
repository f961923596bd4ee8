"""Orders from the page: by whom, and never by nobody; and many vehicles on one page."""

from __future__ import annotations

import re
import signal
import subprocess

import pytest
from panel_bench import PATIENCE, PHONE, fits, hold, log_in, password_file, picture, word
from panel_vehicles import open_vehicle, ready_to_reset, until
from playwright.sync_api import expect

from chute_ros.supervisor.machine import Stage

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")


def test_twenty_vehicles_on_a_phone_the_worst_first(fly, namespace, start_panel, open_page):
    stages = {f"drone{number:02}": Stage.READY for number in range(20)}
    stages |= {"drone07": Stage.FAULT, "drone13": Stage.DEPLOYING, "drone19": Stage.BLOCKED}
    fly(stages)
    panel = start_panel()
    page = open_page(f"{panel.address}/fleet", PHONE)
    seen = page.locator(".vehicle:not(.old)")
    until(fly, lambda: seen.count() == 20, page)
    names = [text.removeprefix(f"{namespace}/") for text in page.locator("h2").all_inner_texts()]
    rest = [name for name in stages if name not in ("drone07", "drone13", "drone19")]
    assert names == ["drone07", "drone13", "drone19", *rest]
    assert fits(page)
    picture(page, "fleet.jpg")


def test_one_who_logged_out_elsewhere_orders_nothing(fly, namespace, panel, open_page):
    vehicles = fly({"drone1": Stage.LANDED})
    address = f"{panel.address}/vehicle{namespace}/drone1"
    page = ready_to_reset(fly, panel, open_page, f"{namespace}/drone1")
    # Given a session that was ended on another page of the same browser,
    other = page.context.new_page()
    other.goto(address)
    other.get_by_role("button", name="log out").click()
    # when the button that is still there is held, by hand or by a script, then nothing is sent.
    expect(page.get_by_text("Log in to give orders.")).to_be_visible(timeout=PATIENCE)
    assert page.locator(".hold:visible").count() == 0
    page.evaluate(
        """() => document.querySelectorAll("button.hold").forEach(
            (one) => one.dispatchEvent(new CustomEvent("held",
                {detail: Number(document.querySelector(".pulse").textContent)})))"""
    )
    expect(page.locator(".answers")).to_contain_text("NOT SENT: log in again", timeout=PATIENCE)
    assert vehicles.resets == []
    assert "safety/reset" not in panel.log()
    # When the session is new, then it is sent, and answered.
    page.reload()
    log_in(page, "Ben")
    page.get_by_text("more orders").click()
    hold(page, "Reset")
    until(fly, lambda: "as at the start" in page.locator(".answers").inner_text(), page)
    assert len(vehicles.resets) == 1
    assert "by='Ben at 127.0.0.1 (panel)'" in panel.log()


def test_beside_the_button_stands_that_no_parachute_can_be_reached(
    fly, namespace, panel, open_page
):
    vehicles = fly({"drone1": Stage.IN_FLIGHT})
    page = open_vehicle(fly, panel, open_page, f"{namespace}/drone1")
    log_in(page)
    note = page.get_by_role("alert").filter(has_text="PARACHUTE")
    # Given a link that lives, and a parachute that says nothing for long,
    until(fly, lambda: "NO PARACHUTE IS RECEIVED" in "".join(note.all_inner_texts()), page)
    # when the link is lost as well, then that is the reason, and what DEPLOY does all the same.
    vehicles.lose_links()
    told = "NO PARACHUTE CAN BE REACHED (mavlink_parachute LOST): DEPLOY: the motors will STOP"
    until(fly, lambda: told in "".join(note.all_inner_texts()), page)
    vehicles.find_links()
    until(fly, lambda: not note.is_visible(), page)


def test_an_order_that_waited_for_a_cut_connection_is_not_obeyed(fly, namespace, panel, open_page):
    vehicles = fly({"drone1": Stage.LANDED})
    page = ready_to_reset(fly, panel, open_page, f"{namespace}/drone1")
    # Given a panel that hears its pages no more,
    panel.processes.send_signal("panel", signal.SIGSTOP)
    # when somebody holds a button before the page has noticed, and it comes back later,
    hold(page, "Reset", 2.0)
    expect(page.locator(".lost-note")).to_be_visible(timeout=PATIENCE)
    panel.processes.send_signal("panel", signal.SIGCONT)
    # then nothing is sent, nor was.
    expect(page.locator(".lost-note")).to_be_hidden(timeout=PATIENCE)
    beat = page.locator(".pulse").text_content()
    until(fly, lambda: page.locator(".pulse").text_content() != beat, page)
    assert vehicles.resets == []
    assert "safety/reset" not in panel.log()


def test_without_permission_there_is_no_button_at_all(fly, namespace, start_panel, open_page):
    fly({"drone1": Stage.FAULT})
    panel = start_panel()
    page = open_vehicle(fly, panel, open_page, f"{namespace}/drone1")
    word(page, "FAULT")
    assert page.locator(".part-banner").get_attribute("role") == "status"
    assert page.locator(".hold").count() == 0
    assert page.get_by_text("log in").count() == 0


def test_what_nobody_looks_at_is_not_listened_to(fly, namespace, panel, open_page):
    vehicles = fly({"drone1": Stage.READY})
    topic = f"{namespace}/drone1/safety/state"
    page = open_page(f"{panel.address}/fleet")
    link = page.locator(f'a[href="/vehicle{namespace}/drone1"]')
    until(fly, link.count, page)
    assert vehicles.count_subscribers(topic) == 0
    link.click()
    until(fly, lambda: vehicles.count_subscribers(topic) == 1, page)
    # Two that look cost what one does.
    other = page.context.new_page()
    other.goto(page.url)
    until(fly, other.locator(".part-banner .word").count, other)
    assert vehicles.count_subscribers(topic) == 1
    page.close()
    other.goto("about:blank")
    until(fly, lambda: vehicles.count_subscribers(topic) == 0, other)
    assert vehicles.count_subscribers(f"{namespace}/drone1/safety/summary") == 0


def test_a_vehicle_that_is_not_there_is_told(panel, open_page):
    page = open_page(f"{panel.address}/vehicle/nowhere")
    told = re.compile("No supervisor is found in /nowhere. Vehicles found: ")
    expect(page.get_by_text(told)).to_be_visible(timeout=PATIENCE)


def test_over_https_a_person_logs_in_and_orders(fly, namespace, start_panel, open_page, tmp_path):
    """Given a certificate of one's own, as for a laptop in the field."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"),
            *("-subj", "/CN=127.0.0.1", "-keyout", str(key), "-out", str(certificate)),
        ],
        check=True,
        capture_output=True,
    )
    vehicles = fly({"drone1": Stage.LANDED})
    files = {"certificate_file": certificate, "key_file": key}
    given = {"allow_commands": "true", "password_file": password_file(tmp_path)}
    panel = start_panel(**files, **given)
    address = panel.address.replace("http:", "https:")
    assert f"panel at {address}" in panel.log()
    page = open_page(f"{address}/vehicle{namespace}/drone1", ignore_https_errors=True)
    until(fly, page.locator(".part-banner .word").count, page)
    log_in(page)
    page.get_by_text("more orders").click()
    hold(page, "Reset")
    until(fly, lambda: vehicles.resets, page)
    (session,) = [one for one in page.context.cookies() if "chute_panel" in one["name"]]
    assert session["secure"]
