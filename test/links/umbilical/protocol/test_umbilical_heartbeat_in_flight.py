"""No <H> from Ascent until the landing: some firmware takes a connected umbilical for a fault.

The flight computer is the simulated one, which goes to Fault for a <H> in Ascent or Coast.
"""

import pytest
from umbilical_lines import BY_NAME, LAYOUTS, STATE
from umbilical_link_bench import ASCENT, COAST, STANDBY, Bench

from chute_ros.links.umbilical.protocol.config import HeartbeatInFlight, UmbilicalConfig
from chute_ros.links.umbilical.protocol.layouts import layout_from
from chute_ros.links.umbilical.protocol.link import UmbilicalLink
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings

START = 1000.0


class Flight:
    """A link and the simulated flight computer, in virtual time."""

    def __init__(self, setting, layouts=LAYOUTS, layout=STATE):
        settings = FlightComputerSettings(faults_on_heartbeat=True, heartbeat_timeout=3.0)
        self.computer = FlightComputer(settings, BY_NAME[layout])
        self.link = UmbilicalLink(UmbilicalConfig(heartbeat_in_flight=setting), list(layouts))
        self.link.owner_alive(float("inf"))
        self.modes = []
        #: Another reader takes from the port what the computer sends.
        self.robbed = False
        self.now = START
        self.link.wire_opened(self.now)

    def until(self, done, most=200.0):
        """Go on in steps of 10 ms until done, at most so many s."""
        end = self.now + most
        while not done():
            assert self.now < end, f"not within {most} s; modes so far: {self.modes}"
            self.now += 0.01
            self.computer.update(self.now)
            for data in self.computer.take_output():
                if not self.robbed:
                    self.link.receive(data, self.now, "port")
            self.link.update(self.now)
            for token in self.link.take_output():
                self.computer.receive(token, self.now)
            self.computer.take_events()
            self.link.take_events()
            if self.modes[-1:] != [self.computer.mode]:
                self.modes.append(self.computer.mode)
        return self

    def launched(self):
        """Armed and launched by command."""
        self.until(lambda: self.link.computer.record is not None)
        self.link.command(1, "key_arm", False, self.now)
        self.until(lambda: self.link.computer.mode == STANDBY)
        self.link.command(2, "launch", True, self.now)
        return self


def test_by_default_the_flight_goes_on_to_the_main():
    flight = Flight(HeartbeatInFlight.AUTO).launched()
    flight.until(lambda: flight.computer.mode in (ComputerMode.MainDeployed, ComputerMode.Fault))
    assert flight.modes[-5:] == [
        ComputerMode.Standby,
        ComputerMode.Ascent,
        ComputerMode.Coast,
        ComputerMode.DrogueDeployed,
        ComputerMode.MainDeployed,
    ]


@pytest.mark.parametrize("seconds", [1.5, 4.0])
def test_where_no_record_can_be_read_after_the_launch_none_is_sent(seconds):
    """Given a second reader of the port, for so long."""
    flight = Flight(HeartbeatInFlight.AUTO).launched()
    flight.until(lambda: flight.computer.mode is ComputerMode.Ascent)
    flight.robbed, begun = True, flight.now
    flight.until(lambda: flight.now > begun + seconds)
    flight.robbed = False
    flight.until(lambda: flight.computer.mode in (ComputerMode.MainDeployed, ComputerMode.Fault))
    assert flight.computer.mode is ComputerMode.MainDeployed


def test_after_a_launch_that_came_to_nothing_they_go_on():
    story = Bench(always_alive=True).talk(flight_mode=STANDBY).at(5.0)
    story.link.command(1, "launch", True, story.now)
    story.at(20.0)
    assert beats(story, 6.5, 20.0) >= 12
    # Nor is its tank vented for long silence.
    story = Bench(always_alive=True).talk(flight_mode=STANDBY).at(5.0)
    story.link.command(1, "launch", True, story.now)
    story.silent().at(40.0)
    assert beats(story, 5.5, 14.9) == 0
    assert beats(story, 15.0, 20.0) >= 4


def test_with_heartbeats_in_flight_such_a_firmware_goes_to_fault():
    flight = Flight(HeartbeatInFlight.YES).launched()
    flight.until(lambda: flight.computer.mode in (ComputerMode.Coast, ComputerMode.Fault))
    assert flight.computer.mode is ComputerMode.Fault


def beats(story, begin, end):
    """How many <H> were written between these times, s."""
    return sum(token == b"<H>" and begin <= at < end for at, token in story.writes)


@pytest.mark.parametrize("mode", [ASCENT, COAST])
def test_heartbeats_end_at_the_second_record_in_flight_and_begin_again_after_the_landing(mode):
    story = Bench(always_alive=True).talk(flight_mode=STANDBY).at(5.0)
    assert beats(story, 0.0, 5.0) >= 4
    story.talk(flight_mode=mode, altitude=500.0).at(5.2)
    story.at(30.0)
    assert beats(story, 5.3, 30.0) == 0
    story.talk(flight_mode=STANDBY, altitude=0.0).at(40.0)
    assert beats(story, 35.0, 40.0) >= 4


def test_neither_silence_nor_one_damaged_record_changes_them():
    # One damaged record does not end the heartbeats on the ground.
    story = Bench(always_alive=True).talk(flight_mode=STANDBY).at(5.0)
    story.talk(flight_mode=ASCENT).at(5.05).talk(flight_mode=STANDBY).at(20.0)
    assert beats(story, 5.0, 20.0) >= 14
    # Silence in flight does not begin them again.
    story = Bench(always_alive=True).talk(flight_mode=ASCENT, altitude=500.0).at(5.0)
    story.silent().at(60.0)
    assert beats(story, 2.0, 60.0) == 0
    # Before anything was heard they are sent.
    assert beats(Bench(always_alive=True).at(5.0), 0.0, 5.0) >= 4


def test_the_parameter_wins_over_the_layout_and_the_layout_is_asked_by_auto():
    content = {
        "name": "own",
        "target_floats": 2,
        "target_fields": [],
        "fields": [
            {"name": field.name, "type": field.kind.name, "unit": "-"}
            for field in BY_NAME[STATE].fields
        ],
    }
    assert not layout_from(content, "here").heartbeat_in_flight
    own = layout_from({**content, "heartbeat_in_flight": True}, "here")
    wants = {HeartbeatInFlight.AUTO: ComputerMode.Fault, HeartbeatInFlight.NO: ComputerMode.Coast}
    for setting, ends in wants.items():
        flight = Flight(setting, layouts=[own]).launched()
        flight.until(
            lambda flight=flight: flight.computer.mode in (ComputerMode.Coast, ComputerMode.Fault)
        )
        assert flight.computer.mode is ends
