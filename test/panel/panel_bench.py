"""The panel as a process of its own, and a browser that looks at it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from playwright.sync_api import expect

from chute_ros.tools.isolation import free_tcp_port
from chute_ros.tools.processes import Processes, ros_arguments

#: How long anything that must happen may take on a busy machine, ms.
PATIENCE = 30_000
PHONE, LAPTOP = (390, 844), (1280, 900)
PASSWORD = "a canopy of silk"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: Gathers every word of the banner, whatever the speed of the test.
_WORDS = """() => {
  window.words = [];
  const look = () => {
    const word = document.querySelector(".part-banner .word");
    const text = word && word.textContent.replace(/^[^A-Z]+/, "").trim();
    if (text && window.words.at(-1) !== text) window.words.push(text);
  };
  look();
  const all = {subtree: true, childList: true, characterData: true};
  new MutationObserver(look).observe(document.body, all);
}"""


def browser_path():
    """The browser of this computer."""
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    assert found, "the panel is tested in a browser: apt install chromium"
    return found


class Panel:
    """One panel. parameters: of its node."""

    def __init__(self, folder, **parameters):
        self.processes = Processes(folder)
        self.port = parameters.setdefault("port", free_tcp_port())
        self.address = f"http://127.0.0.1:{self.port}"
        # NiceGUI would take it for a test of its own.
        name = "PYTEST_CURRENT_TEST"
        kept = os.environ.pop(name, "")
        try:
            more = ros_arguments("/", **parameters)
            self.processes.start("panel", "chute_ros.tools.panel", *more)
        finally:
            os.environ[name] = kept

    def log(self):
        """All that it wrote."""
        return self.processes.log("panel").read_text()

    def started(self, await_until):
        """Once it listens."""
        await_until(lambda: "panel at http" in self.log(), f"the panel listens\n{self.log()}")
        return self

    def close(self):
        """Ctrl-C."""
        self.processes.end()


def password_file(folder):
    """A file with PASSWORD, for its user alone."""
    file = folder / "password"
    file.write_text(f"{PASSWORD}\n")
    file.chmod(0o600)
    return file


def log_in(page, name="Anna"):
    """Through the form, from a vehicle's page."""
    log_in_with(page, name, PASSWORD)


def log_in_with(page, name, password):
    """The same, with another password."""
    page.get_by_role("link", name="log in").click()
    page.get_by_label("Your name").fill(name)
    page.get_by_label("Password").fill(password)
    page.get_by_role("button", name="Log in").click()


def word(page, text):
    """Wait until the state in large is this."""
    expect(page.locator(".part-banner .word")).to_contain_text(text, timeout=PATIENCE)


def watch_words(page):
    """From now on gather the states in large; window.words has them."""
    page.evaluate(_WORDS)


def hold(page, name, seconds=None):
    """Press a button as a finger would, for so long; None: until it is counted as held."""
    press(page, name)
    if seconds is None:
        page.wait_for_function("!document.querySelector('.holding')", timeout=PATIENCE)
    else:
        page.wait_for_timeout(seconds * 1000)
    page.mouse.up()


def press(page, name):
    """A finger on a button, which counts from now on: a page that was opened just now does not
    count it before its first beats."""
    for _ in range(20):
        # Once it stays where it is.
        page.get_by_role("button", name=name, exact=True).hover(timeout=PATIENCE)
        page.mouse.down()
        if page.locator(".holding").count():
            return
        page.mouse.up()
        page.wait_for_timeout(250)
    raise AssertionError(f"{name} is not counted as held")


def picture(page, name, whole=False):
    """Keep what is seen, where make pictures wants it for the docs. whole: with what is below."""
    if folder := os.environ.get("CHUTE_PICTURES"):
        file = Path(folder) / name
        page.evaluate("window.scrollTo(0, 0)")
        page.screenshot(path=file, type="jpeg", quality=70, animations="disabled", full_page=whole)


def fits(page):
    """Nothing is wider than the screen."""
    return page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
