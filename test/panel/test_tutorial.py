"""docs/guide/tutorial.md, done as it says, step by step: what is bold stands on the page."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from panel_bench import PATIENCE, hold, log_in_with, picture, word
from playwright.sync_api import expect

from chute_ros.supervisor.machine import Stage
from chute_ros.tools.isolation import free_tcp_port
from chute_ros.tools.processes import Processes

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")

PAGE = Path(__file__).parents[2] / "docs/guide/tutorial.md"
WORDS = {one.name.replace("_", " ") for one in Stage}
_STEP = re.compile(r"\| (?P<do>[^|]+) \| (?P<see>[^|]+) \|")
_BOLD = re.compile(r"\*\*(.+?)\*\*")
_PICTURE = re.compile(r"!\[.*\]\(pictures/(.+)\)")


def steps():
    """(what is done, what is seen) of each row, and the names of pictures, in their order."""
    for line in PAGE.read_text().splitlines():
        if found := _PICTURE.fullmatch(line):
            yield found[1]
        elif (found := _STEP.fullmatch(line)) and found["do"] not in ("do", "---"):
            yield found["do"], _BOLD.findall(found["see"])


@pytest.fixture
def address(namespace, tmp_path, await_until):
    """`make sim`, and where its panel is, with the password."""
    processes = Processes(tmp_path)
    port = free_tcp_port()
    kept = os.environ.pop("PYTEST_CURRENT_TEST")
    try:
        arguments = ("--namespace", namespace, "--port", str(port))
        processes.start("sim", "chute_ros.tools.sim", *arguments)
    finally:
        os.environ["PYTEST_CURRENT_TEST"] = kept
    said = processes.log("sim")
    await_until(lambda: "Ctrl-C ends it all" in said.read_text(), "it can be played with", 60.0)
    password = re.search(r"password +(\S+)", said.read_text())[1]
    yield re.search(r"panel +(\S+)", said.read_text())[1], password
    processes.end()
    assert "Traceback" not in said.read_text()


def do(page, what, password):
    """One step, as a person reads it."""
    told = _BOLD.findall(what)
    if what.startswith("press"):
        page.get_by_role("button", name=told[0], exact=True).click()
    elif what.startswith("open the tab"):
        page.get_by_role("tab", name=told[0], exact=True).click()
    elif what.startswith("hold"):
        more = page.locator("details:not([open]) summary")
        if more.count():
            more.click()
        hold(page, told[0])
    elif what == "log in":
        log_in_with(page, "Anna", password)
    else:
        assert what in ("look", "wait")


def sees(page, text):
    if text in WORDS:
        word(page, text)
    else:
        expect(page.locator("body")).to_contain_text(text, timeout=PATIENCE)


@pytest.mark.long
def test_the_tutorial_is_true(address, open_page):
    where, password = address
    page = open_page(where)
    done = 0
    for step in steps():
        if isinstance(step, str):
            picture(page, step)
            continue
        what, seen = step
        do(page, what, password)
        for text in seen:
            sees(page, text)
        done += 1
    assert done >= 20
