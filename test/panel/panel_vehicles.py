"""Vehicles as far as a page sees them, for the tests of the panel."""

from __future__ import annotations

import pytest
from chute_msgs.msg import ParachuteStatus, SafetyState, SafetySummary
from heard_vehicle import parachute, state
from panel_bench import log_in
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from chute_ros.model import LinkState
from chute_ros.ros import qos


class Vehicles(Node):
    """Supervisors of many vehicles, as far as a page sees them."""

    def __init__(self, base, stages):
        super().__init__("vehicles", namespace=base)
        self.resets = []
        self._told = []
        self._names = list(stages)
        for name, stage in stages.items():
            self._add(name, stage)
        self.create_timer(0.5, self._tell)

    def _add(self, name, stage):
        whole = state(state=int(stage), state_text=stage.name)
        short = SafetySummary(
            supervisor="safety_supervisor",
            state=int(stage),
            state_name=stage.name,
            text=stage.name,
            links_ok=1,
            links=1,
        )
        for kind, topic, message in (
            (SafetyState, "safety/state", whole),
            (SafetySummary, "safety/summary", short),
        ):
            publisher = self.create_publisher(kind, f"{name}/{topic}", qos.LATCHED)
            self._told.append((publisher, message))
        self.create_service(Trigger, f"{name}/safety/reset", self._reset)

    def lose_links(self):
        """Every parachute is out of reach."""
        self._links(LinkState.LOST)

    def find_links(self):
        """And is back, with a word of itself."""
        self._links(LinkState.OK)
        for name in self._names:
            publisher = self.create_publisher(ParachuteStatus, f"{name}/parachute/status", 10)
            self._told.append((publisher, parachute()))

    def _links(self, link_state):
        for _, message in self._told:
            if isinstance(message, SafetyState):
                message.link_states = [int(link_state)]

    def _tell(self):
        for publisher, message in self._told:
            message.header.stamp = self.get_clock().now().to_msg()
            publisher.publish(message)

    def _reset(self, request, response):
        self.resets.append(request)
        response.success, response.message = True, "as at the start"
        return response


def vehicles_in(namespace):
    """fly(stages): vehicles in these states, which live while the page is waited for."""
    executor, nodes = SingleThreadedExecutor(), []

    def fly(stages):
        nodes.append(Vehicles(namespace, stages))
        executor.add_node(nodes[-1])
        return nodes[-1]

    fly.spin = lambda: executor.spin_once(timeout_sec=0.01)
    yield fly
    executor.shutdown()
    for one in nodes:
        one.destroy_node()


def until(fly, condition, page):
    """Both live until this holds."""
    for _ in range(3000):
        fly.spin()
        page.wait_for_timeout(10)
        if condition():
            return
    pytest.fail(f"not in time; the page shows: {page.locator('body').inner_text()}")


def open_vehicle(fly, panel, open_page, namespace):
    """Its page, as soon as the panel has found it."""
    page = open_page(f"{panel.address}/vehicle{namespace}")
    until(fly, page.locator(".part-banner .word").count, page)
    return page


def ready_to_reset(fly, panel, open_page, namespace):
    """Logged in, with the button Reset in reach."""
    page = open_vehicle(fly, panel, open_page, namespace)
    log_in(page)
    until(fly, page.get_by_text("more orders").is_visible, page)
    page.get_by_text("more orders").click()
    beat = page.locator(".pulse")
    until(fly, lambda: int(beat.text_content() or 0) > 4, page)
    return page
