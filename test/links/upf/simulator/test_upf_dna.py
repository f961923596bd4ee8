"""Dynamic node ids: a device asks, our allocator gives; the library's: test_upf_third_party."""

from itertools import pairwise

import pytest
from upf_device_bench import Story, definitions

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.simulator.dna import FOLLOWUP_DELAY, REQUEST_PERIOD, NodeIdClient
from chute_ros.links.upf.simulator.node import NodeSettings
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS, UpfTrigger
from chute_ros.model import ParachuteState as S
from chute_ros.protocol.dronecan.allocation import MESSAGE, Allocator

DYNAMIC = {p.STATIC_NODE_ID: 0}
UNIT = bytes(range(16))


class Office:
    """The vehicle of a story gives out node ids."""

    def __init__(self, story, table=None):
        self.story = story
        self.allocator = Allocator(table or {}, {33, 34})
        self.given = {}
        self.requests = []
        self._served = 0

    def run(self, seconds):
        """Let time pass, and serve."""
        for _ in range(round(seconds / 0.01)):
            self.story.run(0.01)
            messages = self.story.vehicle.messages.get(MESSAGE, [])
            for message in messages[self._served :]:
                self.requests.append(message)
                self.allocator.heard(message.source, message.values, {}, True, self.story.now)
            self._served = len(messages)
            for keep in self.allocator.take_keep():
                self.allocator.kept(keep.number)
            for answer in self.allocator.take_answers():
                self.given[answer["unique_id"]] = answer["node_id"]
                self.story.vehicle.endpoint.broadcast(MESSAGE, answer)
            self.story.exchange()
        return self


def test_a_device_without_an_id_asks_in_three_parts_and_works_with_what_it_gets():
    story = Story(values=DYNAMIC)
    office = Office(story).run(4.0)
    parts = [len(message.values["unique_id"]) for message in office.requests]
    assert parts == [6, 6, 4]
    assert [message.source for message in office.requests] == [0, 0, 0]
    first = [message.values["first_part_of_unique_id"] for message in office.requests]
    assert first == [True, False, False]
    unique_id = b"".join(message.values["unique_id"] for message in office.requests)
    assert unique_id == story.controller.settings.unique_id
    assert office.given[unique_id] == story.controller.node_id == 125
    assert story.state is S.READY
    assert story.ask("DEPLOY_FORCE", 125) == "SUCCESS"
    office.run(0.5)
    assert story.state is S.LAUNCHED


def test_it_never_speaks_but_to_ask_while_it_has_no_id():
    story = Story(values=DYNAMIC, trigger_values=DYNAMIC)
    story.run(5.0)
    story.bus.act("deploy")
    story.run(5.0)
    assert set(story.vehicle.messages) == {MESSAGE}
    assert story.asked() == []
    assert any("no node id" in event for _, event in story.log)


def test_a_trigger_without_an_id_hears_that_all_triggers_are_to_fire():
    story = Story(trigger_values=DYNAMIC).run(1.0)
    story.ask("DEPLOY_FORCE")
    story.run(1.0)
    assert story.trigger.fired


def test_two_that_ask_at_once_get_two_ids():
    story = Story(values=DYNAMIC, trigger_values=DYNAMIC)
    office = Office(story).run(20.0)
    ids = {story.controller.node_id, story.trigger.node_id}
    assert len(ids) == 2
    assert 0 not in ids
    assert set(office.allocator.table.values()) == ids


@pytest.mark.parametrize("count", [3, 6])
def test_a_bus_full_of_them_ends_with_an_id_each(count):
    story = Story(values=DYNAMIC, trigger_values=DYNAMIC)
    for number in range(count):
        settings = NodeSettings(f"upf.trigger{number}", TRIGGER_PARAMETERS | DYNAMIC)
        story.bus.nodes.append(UpfTrigger(definitions(), settings))
    office = Office(story)
    for _ in range(60):
        office.run(1.0)
        if all(node.node_id for node in story.bus.nodes):
            break
    # Nobody asks again, or loses it.
    office.run(5.0)
    ids = [node.node_id for node in story.bus.nodes]
    assert 0 not in ids
    assert len(set(ids)) == len(ids)


# The client alone, rule by rule


class Client:
    """A client and what it asked, at t+ the start."""

    def __init__(self):
        self.one = NodeIdClient(UNIT)
        self.now = 0.0
        self.asked = []
        self.one.start(0.0)

    def until(self, limit):
        while self.one.next_deadline() <= limit:
            self.now = self.one.next_deadline()
            self.one.update(self.now)
            self.asked += [(self.now, one) for one in self.one.take_requests()]
        self.now = limit

    def hear(self, said, node_id=0, source=10):
        self.one.heard(source, {"unique_id": said, "node_id": node_id}, self.now)


def test_rules_a_and_b_it_asks_at_random_intervals():
    client = Client()
    client.until(60.0)
    times = [0.0, *(when for when, _ in client.asked)]
    gaps = [round(b - a, 9) for a, b in pairwise(times)]
    assert all(REQUEST_PERIOD[0] <= gap <= REQUEST_PERIOD[1] for gap in gaps)
    assert len(set(gaps)) > len(gaps) / 2
    assert all(ask["unique_id"] == UNIT[:6] for _, ask in client.asked)


def test_rule_c_any_allocation_puts_off_the_next_request():
    for source in (0, 10):
        client = Client()
        for _ in range(100):
            client.until(client.now + 0.3)
            client.hear(b"\xff" * 6, source=source)
        assert client.asked == [], source


def test_rule_d_it_sends_what_follows_what_was_heard():
    for known in (6, 12, 7):
        client = Client()
        client.hear(UNIT[:known])
        client.until(FOLLOWUP_DELAY[1])
        ((when, ask),) = client.asked
        assert 0.0 <= when <= FOLLOWUP_DELAY[1]
        assert ask["unique_id"] == UNIT[known : known + 6], known
        assert not ask["first_part_of_unique_id"]


def test_rule_d_another_allocation_ends_the_wait_and_what_other_nodes_ask_is_no_answer():
    for said in ([(UNIT[:6], 10), (b"\xff" * 6, 0)], [(UNIT[:6], 0)]):
        client = Client()
        for part, source in said:
            client.hear(part, source=source)
        client.until(0.5)
        assert client.asked == [], said


def test_rule_e_a_whole_match_with_an_id_is_its_id():
    client = Client()
    client.hear(UNIT, node_id=0)
    assert client.one.node_id == 0
    client.hear(bytes(16), node_id=55)
    assert client.one.node_id == 0
    client.hear(UNIT, node_id=0x35)
    assert client.one.node_id == 0x35
    client.until(60.0)
    assert client.asked == []
    client.hear(UNIT, node_id=77)
    assert client.one.node_id == 0x35, "it has one"
