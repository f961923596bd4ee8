"""A rocket's whole flight on its page: cable, flash, key, launch, apogee, drogue, main."""

from __future__ import annotations

import re

import pytest
from panel_bench import PATIENCE, hold, log_in, password_file, picture, watch_words, word
from playwright.sync_api import expect
from rocket_operator import commands_to

from chute_ros.tools.processes import Processes
from chute_ros.tools.rocket_rig import DemoRocketRig

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")


@pytest.fixture
def rig(namespace, tmp_path):
    """A rocket whose cable is not plugged in yet, and its ground station."""
    folder = tmp_path / "rocket"
    folder.mkdir()
    processes = Processes(folder)
    one = DemoRocketRig("", namespace, processes, folder)
    one.start_ground()
    yield one
    processes.end()


@pytest.fixture
def command(namespace):
    """command(name): as the operator's own tools send it to the flight computer."""
    yield from commands_to(namespace)


def test_a_rocket_from_the_cable_to_the_main(
    rig, command, namespace, start_panel, open_page, tmp_path
):
    panel = start_panel(allow_commands="true", password_file=password_file(tmp_path))
    page = open_page(f"{panel.address}/fleet")
    page.locator(f'a[href="/vehicle{namespace}"]').click(timeout=PATIENCE)
    log_in(page)
    word(page, "BLOCKED")
    rocket, answers = page.locator(".part-rocket"), page.locator(".answers").first
    assert rocket.locator("section").count() == 0
    # When the cable is plugged in, then the flight computer tells what it knows.
    rig.plug_cable_in()
    word(page, "READY")
    for text in (
        "flight modeSTARTUP",
        "keynot armed",
        "main valveclosed",
        "droguenot deployed",
        "no dump or wipe",
    ):
        expect(rocket).to_contain_text(text, timeout=PATIENCE)
    # Given a flash that was not wiped, then arming is refused, with the reason.
    hold(page, "Arm parachutes")
    expect(answers).to_contain_text("arm: NOT DONE", timeout=PATIENCE)
    expect(answers).to_contain_text("flash")
    assert command("wipe_flash").success
    word(page, "READY")
    hold(page, "Arm parachutes")
    expect(answers).to_contain_text("arm: done", timeout=PATIENCE)
    word(page, "ARMED")
    expect(rocket).to_contain_text("keyARMED", timeout=PATIENCE)
    # When it is launched, then every stage is seen.
    watch_words(page)
    assert command("launch", force=True).confirmed
    expect(rocket).to_contain_text("main valveOPEN", timeout=PATIENCE)
    expect(rocket).to_contain_text("flight modeCOAST", timeout=PATIENCE)
    word(page, "IN FLIGHT")
    # Its height and its curve are of the same moment, as far as a rocket has moments.
    expect(page.locator(".part-vehicle")).to_contain_text(
        re.compile(r"height\d{3,4}\."), timeout=PATIENCE
    )
    expect(page.locator(".curves")).to_contain_text(re.compile(r"\d,\d{3}"), timeout=PATIENCE)
    picture(page, "rocket.jpg", whole=True)
    # When it falls past its apogee without a drogue, then the operator releases it on the page.
    expect(page.locator(".part-vehicle")).to_contain_text("vertical speed-", timeout=PATIENCE)
    hold(page, "DEPLOY")
    expect(answers).to_contain_text("deploy: done", timeout=PATIENCE)
    expect(rocket).to_contain_text("drogueDEPLOYED", timeout=PATIENCE)
    expect(rocket).to_contain_text("main parachuteDEPLOYED", timeout=PATIENCE)
    word(page, "DEPLOYED")
    assert page.evaluate("window.words")[:2] == ["ARMED", "IN FLIGHT"]
