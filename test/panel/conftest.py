"""What the tests of the panel share: a browser, and panels that are ended."""

from __future__ import annotations

import pytest
from panel_bench import LAPTOP, Panel, browser_path, password_file
from panel_vehicles import vehicles_in
from playwright.sync_api import sync_playwright


@pytest.fixture(scope="module")
def browser():
    """Chromium without a screen. While it lives its thread has an event loop that runs."""
    with sync_playwright() as playwright:
        # Root, as in containers, has no sandbox.
        one = playwright.chromium.launch(executable_path=browser_path(), args=["--no-sandbox"])
        yield one
        one.close()


@pytest.fixture
def open_page(browser):
    """open_page(address, size, **options): a page in a browser of its own."""
    contexts = []

    def make(address, size=LAPTOP, **options):
        width, height = size
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        page = context.new_page()
        page.goto(address)
        return page

    yield make
    for context in contexts:
        context.close()


@pytest.fixture
def start_panel(tmp_path, await_until, ros):
    """start_panel(**parameters): one that listens."""
    panels = []

    def make(**parameters):
        panels.append(Panel(tmp_path, **parameters))
        return panels[-1].started(await_until)

    yield make
    for one in panels:
        one.close()


@pytest.fixture(scope="module")
def panel_of_module(tmp_path_factory, await_until, ros):
    folder = tmp_path_factory.mktemp("panel")
    one = Panel(folder, allow_commands="true", password_file=password_file(folder))
    yield one.started(await_until)
    one.close()


@pytest.fixture
def panel(panel_of_module):
    """One that takes orders, for all tests of a module: each leaves it as it was, and reads the
    log of its own time."""
    panel_of_module.log_begins_now()
    return panel_of_module


@pytest.fixture
def fly(namespace):
    yield from vehicles_in(namespace)
