#!/usr/bin/env python3
"""How long it takes from `git clone` to a parachute that was released on the panel's page.

Clones this repository into a new folder, runs `make sim` there with an empty HOME, and does in a
browser what docs/guide/tutorial.md says. Run by `make newcomer`, in an environment made by
set_up.py, which has the browser's driver; the clone has an environment of its own. Writes
docs/evidence/newcomer.md.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from panel_bench import PATIENCE, browser_path, hold, log_in_with, word
from playwright.sync_api import Page, expect, sync_playwright

from chute_ros.tools.isolation import free_tcp_port
from chute_ros.tools.machine import machine
from chute_ros.tools.pages import table

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/evidence/newcomer.md"
#: How long the set-up may take, s.
_SET_UP = 1800.0
#: What this environment has set, and a newcomer has not.
_OURS = re.compile(r"_?(ROS|AMENT|COLCON|CHUTE|CMAKE|PYTHON|LD_LIBRARY|VIRTUAL|RMW|MAKE|MFLAGS).*")


def main() -> None:
    """Do it, and write the page."""
    began = time.monotonic()
    steps: list[tuple[str, float]] = []

    def step(name: str) -> None:
        steps.append((name, time.monotonic() - began))
        print(f"{steps[-1][1]:7.1f} s  {name}", flush=True)

    with tempfile.TemporaryDirectory(prefix="chute_ros_newcomer_") as folder:
        clone, home = Path(folder) / "chute_ros", Path(folder) / "home"
        home.mkdir()
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        step("`git clone`")
        log = Path(folder) / "sim.log"
        environment = {name: text for name, text in os.environ.items() if not _OURS.match(name)}
        paths = [one for one in environment["PATH"].split(":") if not one.startswith(str(ROOT))]
        environment |= {"HOME": str(home), "PATH": ":".join(paths)}
        port = free_tcp_port()
        with log.open("wb") as file:
            sim = subprocess.Popen(
                ["make", "sim", f"PORT={port}"],
                cwd=clone,
                env=environment,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        try:
            while "Ctrl-C ends it all" not in log.read_text():
                if sim.poll() is not None or time.monotonic() > began + _SET_UP:
                    sys.exit(f"make sim did not get ready:\n{log.read_text()[-4000:]}")
                time.sleep(0.2)
            step("`make sim` has set everything up, built it, and tells the page's address")
            told = log.read_text()
            address = re.search(r"panel +(\S+)", told)
            password = re.search(r"password +(\S+)", told)
            assert address is not None
            assert password is not None
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(
                    executable_path=browser_path(), args=["--no-sandbox"]
                )
                page = browser.new_page()
                page.goto(address[1])
                _play(page, password[1], step)
                browser.close()
        finally:
            os.killpg(sim.pid, signal.SIGINT)
            sim.wait(30.0)
    head = ("since the start (s)", "step")
    rows = [(f"{at:.0f}", name) for name, at in steps]
    PAGE.write_text(
        "# From the clone to a released parachute\n\n"
        "Written by `make newcomer`, which does what [the tutorial](../guide/tutorial.md)\n"
        "says in a fresh clone with an empty HOME, as fast as a program can.\n"
        "A person also reads.\n"
        f"{machine()}.\n\n{table(head, rows)}\n"
    )


def _play(page: Page, password: str, step: Callable[[str], None]) -> None:
    word(page, "READY")
    step("the page shows READY")
    log_in_with(page, "Newcomer", password)
    hold(page, "Arm parachutes")
    word(page, "ARMED")
    step("logged in, and armed the parachute")
    page.get_by_role("tab", name="Bench", exact=True).click()
    page.get_by_role("button", name="Take off", exact=True).click()
    word(page, "IN FLIGHT")
    expect(page.locator(".part-vehicle")).to_contain_text("60.0 m", timeout=PATIENCE)
    step("in flight, at 60 m")
    hold(page, "DEPLOY")
    word(page, "DEPLOYED")
    step("held DEPLOY: the parachute is released")


if __name__ == "__main__":
    main()
