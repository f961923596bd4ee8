"""A button that is held orders once, and only while the finger is on it."""

from __future__ import annotations

import pytest
from panel_bench import press
from panel_vehicles import ready_to_reset, until
from playwright.sync_api import expect

from chute_ros.supervisor.machine import Stage

# One browser at a time: it takes a core of its own.
pytestmark = pytest.mark.xdist_group("browser")
#: Longer than a button must be held, ms; and until an order that was given would have come.
HELD, CAME = 1900, 1500


@pytest.fixture
def vehicles(fly):
    return fly({"drone1": Stage.LANDED})


@pytest.fixture
def page(fly, vehicles, namespace, panel, open_page):
    return ready_to_reset(fly, panel, open_page, f"{namespace}/drone1")


def orders(fly, vehicles, page, wait=CAME):
    """How many came."""
    for _ in range(wait // 20):
        fly.spin()
        page.wait_for_timeout(10)
    return len(vehicles.resets)


def test_a_finger_that_left_while_the_page_stood_still_orders_nothing(fly, vehicles, page):
    press(page, "Reset")
    page.evaluate(
        """() => setTimeout(() => {
            const end = performance.now() + 2500;
            while (performance.now() < end);
        }, 300)"""
    )
    page.wait_for_timeout(100)
    # Given a page that does not run from 0.3 s on, when the finger leaves meanwhile, then nothing.
    page.mouse.up(button="left")
    assert orders(fly, vehicles, page, 4000) == 0


def test_a_hold_over_which_the_page_stood_still_orders_nothing(fly, vehicles, page):
    press(page, "Reset")
    page.evaluate(
        """() => {
            const end = performance.now() + 2500;
            while (performance.now() < end);
        }"""
    )
    page.wait_for_timeout(500)
    page.mouse.up()
    assert orders(fly, vehicles, page) == 0


def test_a_left_button_that_is_let_go_while_the_right_one_is_down_orders_nothing(
    fly,
    vehicles,
    page,
):
    press(page, "Reset")
    page.mouse.down(button="right")
    page.mouse.up(button="left")
    page.wait_for_timeout(HELD)
    page.mouse.up(button="right")
    assert orders(fly, vehicles, page) == 0


def test_a_key_whose_button_lost_the_focus_orders_nothing(fly, vehicles, page):
    page.get_by_role("button", name="Reset").focus()
    page.keyboard.down(" ")
    expect(page.locator(".holding")).to_have_count(1)
    page.get_by_label("reason, for the record").focus()
    page.wait_for_timeout(HELD)
    page.keyboard.up(" ")
    assert orders(fly, vehicles, page) == 0


def test_another_window_that_comes_before_it_ends_the_hold(fly, vehicles, page):
    press(page, "Reset")
    page.evaluate("() => window.dispatchEvent(new Event('blur'))")
    page.wait_for_timeout(HELD)
    page.mouse.up()
    assert orders(fly, vehicles, page) == 0


def test_a_button_that_is_held_for_long_orders_once(fly, vehicles, page):
    press(page, "Reset")
    page.wait_for_timeout(2 * HELD)
    page.mouse.up()
    until(fly, lambda: vehicles.resets, page)
    assert orders(fly, vehicles, page) == 1


def test_a_burst_of_orders_by_a_script_is_one(fly, vehicles, page):
    page.evaluate(
        """() => {
            const [button] = [...document.querySelectorAll("button.hold")].filter(
                (one) => one.textContent.includes("Reset"));
            const beat = Number(document.querySelector(".pulse").textContent);
            for (let n = 0; n < 50; n++)
                button.dispatchEvent(new CustomEvent("held", {detail: beat}));
        }"""
    )
    until(fly, lambda: vehicles.resets, page)
    assert orders(fly, vehicles, page) == 1


def test_a_burst_that_a_busy_panel_obeys_slowly_is_one(fly, vehicles, page):
    beat = int(page.locator(".pulse").text_content())
    for _ in range(2):
        page.evaluate(
            """(beat) => [...document.querySelectorAll("button.hold")].filter(
                (one) => one.textContent.includes("Reset"))[0].dispatchEvent(
                    new CustomEvent("held", {detail: beat}))""",
            beat,
        )
        # Given 1.1 s between the two, as a panel without a processor would count them.
        page.wait_for_timeout(1100)
    until(fly, lambda: vehicles.resets, page)
    assert orders(fly, vehicles, page) == 1
    assert "eset: NOT SENT: " in page.locator(".answers").inner_text()


def test_an_order_without_a_beat_of_now_is_refused(fly, vehicles, page):
    told = "NOT SENT: the page was not connected"
    new = page.locator(".answers > :not([data-seen])", has_text=told)
    for beat in ("null", "NaN", "-1", "1e9", "'x'", "[1]", "undefined"):
        page.evaluate(
            f"""() => {{
                document.querySelectorAll(".answers > *").forEach((one) => one.dataset.seen = "");
                document.querySelectorAll("button.hold").forEach((one) =>
                    one.dispatchEvent(new CustomEvent("held", {{detail: {beat}}})));
            }}"""
        )
        until(fly, new.count, page)
    assert orders(fly, vehicles, page) == 0
