"""The panel as a process of its own, and a browser that looks at it."""

from __future__ import annotations

import io
import os
import re
import shutil
from pathlib import Path

from playwright.sync_api import expect
from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

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
        self._log_begins = 0
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
        """All that it wrote, since log_begins_now if that was called."""
        return self.processes.log("panel").read_text()[self._log_begins :]

    def log_begins_now(self):
        """What it has written is of before."""
        self._log_begins += len(self.log())

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


class Patience:
    """Of who waits for a terminal while a browser is open (test/tools/chute_bench.py)."""

    def __init__(self, page, namespace):
        self._page, self.namespace = page, namespace

    def until(self, condition, what, seconds=PATIENCE / 1000):
        """Wait until this holds."""
        for _ in range(int(seconds * 20)):
            if condition():
                return
            self._page.wait_for_timeout(50)
        raise AssertionError(f"{what} did not happen within {seconds:g} s")


def terminal_rows(shown):
    """Number -> the row of a full screen, with its colours, as it was sent last."""
    parts = re.findall(r"\x1b\[(\d+);1H(.*?)\x1b\[K", shown, re.DOTALL)
    return {int(number): row for number, row in parts}


def terminal_picture(page, shown, name):
    """The same for what a terminal of 80 columns shows."""
    if not os.environ.get("CHUTE_PICTURES"):
        return
    console = Console(record=True, width=80, file=io.StringIO())
    for _, row in sorted(terminal_rows(shown).items()):
        console.print(Text.from_ansi(row), no_wrap=True, overflow="crop")
    page.set_viewport_size({"width": 820, "height": 560})
    page.set_content(console.export_html(inline_styles=True, theme=MONOKAI))
    picture(page, name, whole=True)


def fits(page):
    """Nothing is wider than the screen."""
    return page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
