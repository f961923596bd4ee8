"""Whole flights seen on the page, and ordered there."""

from __future__ import annotations

import json
import re
import signal

import pytest
from chute_bench import AtTerminal
from command_bench import tool
from panel_bench import (
    PATIENCE,
    PHONE,
    Patience,
    fits,
    hold,
    log_in,
    picture,
    terminal_picture,
    terminal_rows,
    watch_words,
    word,
)
from playwright.sync_api import expect

from chute_ros.tools.demo_rig import DemoRig
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import Processes

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")


@pytest.fixture
def hangar(request, namespace, tmp_path):
    """A drone of which nothing runs yet: with a MAVLink parachute, or of the kind that a test
    names."""
    folder = tmp_path / "vehicle"
    folder.mkdir()
    processes = Processes(folder)
    yield DemoRig.on_free_ports(getattr(request, "param", "mavlink"), "", namespace, processes)
    processes.end()


@pytest.fixture
def rig(hangar):
    """A drone whose parachute is not plugged in yet."""
    hangar.start_supervisor("supervisor")
    hangar.start_vehicle()
    return hangar


@pytest.fixture
def pilot(hangar):
    one = Pilot(hangar.pilot, 1)
    yield one
    one.close()


def opened(rig, panel, open_page):
    """The page of the vehicle, found from the page of the fleet, its parachute plugged in."""
    rig.start_parachute()
    page = open_page(f"{panel.address}/fleet")
    page.locator(f'a[href="/vehicle{rig.namespace}"]').click(timeout=PATIENCE)
    return page


def answered(page, text):
    """Wait until an answer to an order is shown."""
    expect(page.locator(".answers")).to_contain_text(text, timeout=PATIENCE)


def test_a_whole_flight_on_a_phone(rig, pilot, panel, open_page):
    # Given a vehicle whose parachute is missing, when somebody looks, then it says why.
    page = open_page(f"{panel.address}/vehicle{rig.namespace}", PHONE, has_touch=True)
    word(page, "BLOCKED")
    expect(page.locator(".part-banner .why")).to_contain_text("mavlink_parachute")
    picture(page, "phone_blocked.jpg")
    watch_words(page)
    # When the parachute is plugged in, then all of it is there.
    rig.start_parachute()
    word(page, "READY")
    card = page.locator(".part-parachutes")
    for text in ("1/161", "2026-06-19", "serial number SIM-0001", "firmware 0.1.0"):
        expect(card).to_contain_text(text, timeout=PATIENCE)
    picture(page, "phone_ready.jpg")
    # When the operator logs in and arms, then the page says so, and who.
    log_in(page)
    word(page, "READY")
    watch_words(page)
    page.get_by_label("reason, for the record").fill("first flight")
    hold(page, "Arm parachutes")
    answered(page, "arm: done")
    word(page, "ARMED")
    expect(card).to_contain_text("YES: ")
    picture(page, "phone_armed.jpg")
    # When it flies and a motor fails, then every state is seen.
    pilot.arm()
    vehicle = page.locator(".part-vehicle")
    expect(vehicle).to_contain_text("arming stateARMED", timeout=PATIENCE)
    pilot.take_off(30.0)
    word(page, "IN FLIGHT")
    expect(vehicle).to_contain_text("height29.", timeout=PATIENCE)
    assert fits(page)
    picture(page, "phone_in_flight.jpg")
    pilot.fail_motor()
    word(page, "DEPLOYED")
    expect(card).to_contain_text("YES, by ")
    picture(page, "phone_deployed.jpg")
    expect(page.locator(".part-decisions")).to_contain_text("DEPLOY by rule")
    expect(vehicle).to_contain_text("ON_GROUND", timeout=PATIENCE)
    words = page.evaluate("window.words")
    assert words[:3] == ["READY", "ARMED", "IN FLIGHT"]
    assert "DEPLOYED" in words
    assert set(words[3:]) <= {"KILLING", "DEPLOYING", "DEPLOYED"}
    # When the operator resets, then it is not released any more, and the record has who did it.
    page.get_by_text("more orders").click()
    # A page that a busy machine cut off says so, and that it is to be held again.
    for _ in range(3):
        hold(page, "Reset")
        answered(page, "reset: ")
        if "safety/reset: " in panel.log():
            break
    assert "safety/arm: arm=True, triggers=0, by='Anna at 127.0.0.1 (panel)'" in panel.log()
    assert "safety/reset: by='Anna at 127.0.0.1 (panel)'" in panel.log()
    assert fits(page)


@pytest.mark.long
def test_a_flight_that_ends_well_on_a_phone(hangar, pilot, panel, open_page):
    # Given a page that waits for its vehicle, when that starts, then it is seen from its start on.
    page = open_page(f"{panel.address}/vehicle{hangar.namespace}", PHONE, has_touch=True)
    expect(page.locator("body")).to_contain_text("No supervisor is found", timeout=PATIENCE)
    hangar.start_supervisor("supervisor", "-p", "startup_grace:=60.0")
    word(page, "STARTUP")
    expect(page.locator(".part-banner .why")).to_contain_text("nothing received from its node")
    assert fits(page)
    picture(page, "phone_startup.jpg")
    hangar.start_vehicle()
    hangar.start_parachute()
    word(page, "READY")
    log_in(page)
    word(page, "READY")
    hold(page, "Arm parachutes")
    word(page, "ARMED")
    assert fits(page)
    watch_words(page)
    pilot.arm()
    vehicle = page.locator(".part-vehicle")
    expect(vehicle).to_contain_text("arming stateARMED", timeout=PATIENCE)
    pilot.take_off(8.0)
    word(page, "IN FLIGHT")
    expect(page.locator(".part-banner .why")).to_have_text("The vehicle flies, and is guarded.")
    expect(vehicle).to_contain_text("height7.", timeout=PATIENCE)
    assert fits(page)
    # When it lands, and the pilot keeps the motors running, then it has landed,
    pilot.land()
    landed = page.locator(".part-banner .word", has_text="LANDED")
    for _ in range(PATIENCE // 100):
        if vehicle.get_by_text("ON_GROUND").count():
            pilot.arm()
        page.wait_for_timeout(100)
        if landed.count():
            break
    word(page, "LANDED")
    # and says that the parachute is live all the same.
    expect(page.locator(".part-banner .why")).to_contain_text("ARMED all the same")
    expect(page.locator(".part-banner .banner")).to_have_class(re.compile("tone-live"))
    assert fits(page)
    picture(page, "phone_landed.jpg")
    # When the motors stop, then the supervisor disarms the parachute.
    pilot.disarm()
    word(page, "READY")
    expect(page.locator(".part-parachutes")).to_contain_text("armedno", timeout=PATIENCE)
    words = page.evaluate("window.words")
    assert words[:3] == ["ARMED", "IN FLIGHT", "LANDED"]
    assert not {"KILLING", "DEPLOYING", "DEPLOYED", "FAULT"} & {*words}


@pytest.mark.long
@pytest.mark.parametrize("hangar", ["both"], indirect=True)
def test_a_vehicle_whose_parachutes_are_lost_in_flight_is_not_guarded(
    rig, pilot, start_panel, open_page
):
    panel = start_panel()
    page = opened(rig, panel, open_page)
    word(page, "READY")
    pilot.arm()
    expect(page.locator(".part-vehicle")).to_contain_text("arming stateARMED", timeout=PATIENCE)
    pilot.take_off(30.0)
    word(page, "IN FLIGHT")
    # When both parachutes fall silent in the air,
    for name in ("parachute", "upf"):
        rig.processes.send_signal(name, signal.SIGSTOP)
    # then nobody takes it for a vehicle that is guarded.
    word(page, "IN FLIGHT, NOT GUARDED")
    expect(page.locator(".part-banner .why")).to_contain_text("no parachute can be reached")
    expect(page.locator(".part-banner .banner")).to_have_class(re.compile("tone-bad"))
    page.set_viewport_size(dict(zip(("width", "height"), PHONE, strict=True)))
    assert fits(page)
    picture(page, "phone_not_guarded.jpg")
    page.goto(f"{panel.address}/fleet")
    card = page.locator(f'a[href="/vehicle{rig.namespace}"]')
    expect(card).to_contain_text("IN FLIGHT, NOT GUARDED", timeout=PATIENCE)
    code, out, _ = tool("chute", "--namespace", rig.namespace, "status", "--json")
    told = json.loads(out)
    assert (code, told["well"], told["unguarded"]) == (1, False, True)
    assert any("no parachute can be reached" in one for one in told["alarms"])


def test_a_kill_and_a_deploy_by_hand(rig, pilot, panel, open_page):
    page = opened(rig, panel, open_page)
    log_in(page)
    word(page, "READY")
    hold(page, "Arm parachutes")
    word(page, "ARMED")
    pilot.arm()
    vehicle = page.locator(".part-vehicle")
    expect(vehicle).to_contain_text("arming stateARMED", timeout=PATIENCE)
    pilot.take_off(30.0)
    word(page, "IN FLIGHT")
    expect(vehicle).to_contain_text("height29.", timeout=PATIENCE)
    answers = page.locator(".answers > *")
    given = answers.count()
    # Given a button that is let go too early, then nothing is ordered.
    hold(page, "DEPLOY", 0.7)
    page.mouse.move(0, 0)
    assert answers.count() == given
    # Given a finger that slides off, then nothing is ordered.
    box = page.get_by_role("button", name="DEPLOY").bounding_box()
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.down()
    page.mouse.move(0, 0)
    page.wait_for_timeout(1800)
    page.mouse.up()
    assert answers.count() == given
    assert "safety/deploy" not in panel.log()
    # When it is held by the keyboard, then the parachute is released, once.
    page.get_by_label("reason, for the record").fill("the motor burns")
    page.get_by_role("button", name="DEPLOY").focus()
    page.keyboard.down(" ")
    answered(page, "deploy: done")
    page.keyboard.up(" ")
    word(page, "DEPLOYED")
    assert panel.log().count("safety/deploy: force=") == 1
    assert "reason='Anna at 127.0.0.1 (panel): the motor burns'" in panel.log()
    expect(page.locator(".part-decisions")).to_contain_text("the motor burns")


@pytest.mark.long
@pytest.mark.parametrize("hangar", ["both"], indirect=True)
def test_a_flight_with_two_parachutes(rig, pilot, panel, open_page):
    page = opened(rig, panel, open_page)
    log_in(page)
    word(page, "READY")
    # Then each parachute has a card, with who its device says it is,
    cards = page.locator(".part-parachutes section")
    expect(cards).to_have_count(2, timeout=PATIENCE)
    mavlink, upf = (cards.filter(has_text=name) for name in ("mavlink_parachute", "upf_can 33"))
    expect(mavlink).to_contain_text("serial number SIM-0001", timeout=PATIENCE)
    expect(upf).to_contain_text("upf.controller", timeout=PATIENCE)
    expect(upf).to_contain_text("own supply8.")
    # both are armed by one order,
    hold(page, "Arm parachutes")
    word(page, "ARMED")
    for card in (mavlink, upf):
        expect(card).to_contain_text("armed◆ YES", timeout=PATIENCE)
    pilot.arm()
    vehicle = page.locator(".part-vehicle")
    expect(vehicle).to_contain_text("arming stateARMED", timeout=PATIENCE)
    pilot.take_off(30.0)
    word(page, "IN FLIGHT")
    expect(vehicle).to_contain_text("height29.", timeout=PATIENCE)
    # and the first one that confirms is enough.
    pilot.fail_motor()
    word(page, "DEPLOYED")
    expect(mavlink).to_contain_text("released▼ YES", timeout=PATIENCE)
    expect(upf).to_contain_text("releasedno")
    expect(page.locator(".part-banner .why")).to_contain_text("mavlink_parachute 1/161 released")
    expect(page.locator(".curves")).to_contain_text("DEPLOY", timeout=PATIENCE)
    picture(page, "two_parachutes.jpg", whole=True)
    expect(vehicle).to_contain_text("ON_GROUND", timeout=PATIENCE)
    # Whoever opens the page now finds the kill and the deploy with their reasons.
    late = open_page(page.url)
    decisions = late.locator(".part-decisions")
    for text in ("KILL by rule", "DEPLOY by rule", "kill confirmed after"):
        expect(decisions).to_contain_text(text, timeout=PATIENCE)
    # So does who has no more than a terminal of 24 rows.
    terminal = AtTerminal(Patience(late, rig.namespace), "watch", rows=24, columns=80)
    terminal.reads("DEPLOY by rule")
    terminal.reads("OK, device NOT healthy")
    terminal.reads("armed, DEPLOYED, link OK")
    terminal.types("q")
    assert terminal.end() == 0
    shown = "\n".join(terminal_rows(terminal.shown).values())
    for text in ("D E P L O Y E D", "released", "KILL by rule", "DEPLOY by rule"):
        assert text in shown
    terminal_picture(late, terminal.shown, "chute_watch.jpg")


def test_what_is_old_is_grey_and_a_panel_that_is_gone_is_told(rig, start_panel, open_page):
    panel = start_panel()
    page = opened(rig, panel, open_page)
    word(page, "READY")
    assert page.locator(".orders").count() == 0
    # When the supervisor falls silent, then its word is not shown as if it were now.
    rig.processes.send_signal("supervisor", signal.SIGSTOP)
    word(page, "NOT KNOWN NOW")
    expect(page.locator(".part-banner .why")).to_contain_text("It was READY; the last word came")
    rig.processes.send_signal("supervisor", signal.SIGCONT)
    word(page, "READY")
    # When the panel itself is gone, then the page says so by itself.
    panel.processes.send_signal("panel", signal.SIGKILL)
    expect(page.locator(".lost-note")).to_be_visible(timeout=PATIENCE)
    assert page.evaluate("document.body.classList.contains('lost')")
