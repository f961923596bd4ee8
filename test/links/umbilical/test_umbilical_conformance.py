"""The kit on the simulated flight computer, sound and broken in each clause, in virtual time."""

import math
from itertools import cycle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit_run import KitRun

from chute_ros.conformance.bench import NotAllowedError
from chute_ros.conformance.clause import SOAK, Risk, Verdict
from chute_ros.conformance.session import Allowed, DeviceFound, Session
from chute_ros.links.umbilical.conformance import CLAUSES
from chute_ros.links.umbilical.conformance.bench import UmbilicalBench
from chute_ros.links.umbilical.conformance.permits import REBOOT, WIPE
from chute_ros.links.umbilical.kit import KIT
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.commands import KINDS
from chute_ros.links.umbilical.simulator.broken import BREAKS
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings

NAMES = [one.name for one in CLAUSES]
LAYOUTS = {one.name: one for one in load_layouts("", "the tests")}
REFERENCE = LAYOUTS["telem57_airbrake_state"]
OPTIONS = (REBOOT, WIPE)


class Run(KitRun):
    """Kit and flight computer on one cable."""

    def __init__(self, device, risk=Risk.FIRES, options=OPTIONS, session=None):
        bench = UmbilicalBench(device.layout, risk, options)
        super().__init__(session or Session(bench, CLAUSES, Allowed(risk, options)), device)


def sound(layout=REFERENCE.name, **knobs):
    return FlightComputer(FlightComputerSettings(**knobs), LAYOUTS[layout])


def simulated(broken):
    """As the kit has it for its evidence."""
    line = KIT.virtual(broken)
    return Run(line.device, session=line.session).to()


# -- what it finds ------------------------------------------------------------------------------


def test_a_sound_device_passes_all_that_can_be_tried():
    run = simulated("")
    assert run.of(Verdict.FAILED) == []
    unseen = ["heartbeat-timeout"]
    wants_options = [one.name for one in CLAUSES if one.needs in OPTIONS]
    assert run.of(Verdict.NOT_TRIED) == [*unseen, *wants_options]
    assert [*run.results] == NAMES
    assert run.problem == ""
    assert run.device.mode is ComputerMode.Startup


def test_what_restarts_and_wipes_passes_with_its_options():
    """Given a flight computer with a snapshot of an earlier flight in its FRAM."""
    device = sound()
    device.memory.snapshot("of a flight before")
    run = Run(device).to()
    assert run.of(Verdict.FAILED) == []
    assert run.of(Verdict.NOT_TRIED) == ["heartbeat-timeout", "soak"]


def test_what_a_log_tells_of_the_connection_is_tried():
    """Given a flight computer in debug mode, which takes 15 s for its limit."""
    run = Run(sound(debug=True)).to()
    assert run.of(Verdict.FAILED) == []
    assert run.results["heartbeat-timeout"].why.startswith("it counts as lost 15.")


@pytest.mark.parametrize("layout", [*LAYOUTS])
def test_a_firmware_of_another_layout_passes_with_its_name(layout):
    run = Run(sound(layout)).to()
    assert run.of(Verdict.FAILED) == []
    assert run.results["field-count"].verdict is Verdict.PASSED
    shows_target = bool(LAYOUTS[layout].target_fields)
    assert (run.results["target"].verdict is Verdict.PASSED) == shows_target


def test_a_firmware_of_another_layout_is_told_without_its_name():
    """Given 54 fields, and a kit that was told of the reference's 57."""
    bench = UmbilicalBench(REFERENCE)
    run = Run(sound("telem54"), session=Session(bench, CLAUSES, Allowed())).to()
    assert run.of(Verdict.FAILED)[0] == "field-count"
    assert "54 fields (need 57" in run.results["field-count"].why
    assert run.results["pressure"].verdict is Verdict.NOT_TRIED
    assert [*run.results] == NAMES


def test_a_firmware_that_vents_by_safe_fails_in_that():
    """Given the known firmware, whose <V> opens the SV; it is left closed all the same."""
    run = Run(sound(safe_opens_sv=True)).to()
    assert run.of(Verdict.FAILED) == ["safe"]
    assert run.problem == ""


def test_a_firmware_that_wants_its_flash_wiped_is_not_armed():
    run = Run(sound(interlock=True), Risk.ARMS, ()).to()
    assert run.of(Verdict.FAILED) == []
    assert run.results["key-arm"].why == "it says: Arming blocked: wipe flash first"


def test_each_clause_has_a_way_to_be_broken():
    assert sorted(BREAKS) == sorted(NAMES)


# -- what shows only at a second look -------------------------------------------------------------


class WaywardComputer(FlightComputer):
    """Wrong in a way that no first line shows. does: in which."""

    does = ""
    _since = math.inf

    def receive(self, data, now, stream=None):
        if self.does == "takes a newline for a bracket":
            data = data.replace(b"\n", b">")
        super().receive(data, now, stream)

    def _telemetry(self):
        flags = self.flight.flags
        if flags.get(self.does):
            self._since = min(self._since, self.now)
            if self.now > self._since + 1.0:
                flags[self.does], self._since = 0, math.inf
        unheard = bool(self.heartbeats) and self.now - self.heartbeats[-1] > 10.0
        if self.does == "opens the MAV" and unheard:
            flags["mav_open"] = 1
        super()._telemetry()


@pytest.mark.parametrize(
    ("does", "clauses"),
    [
        ("mav_open", ["open-mav"]),
        ("sv_open", ["open-sv"]),
        ("ssa_drogue_deployed", ["drogue"]),
        ("opens the MAV", ["unconnected"]),
        ("takes a newline for a bracket", ["nearly-arms", "nearly-fires"]),
        ("", []),
    ],
)
def test_what_shows_at_a_second_look_fails(does, clauses):
    device = WaywardComputer(FlightComputerSettings(), REFERENCE)
    device.does = does
    assert Run(device).to().of(Verdict.FAILED) == clauses


def test_a_magnetometer_in_gauss_fails():
    device = sound()
    device.overrides |= {"mag_x": 0.1825, "mag_y": -0.048, "mag_z": -0.476}
    assert Run(device).to().of(Verdict.FAILED) == ["magnetometer"]


# -- whatever it is told -------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*KINDS])
def test_a_device_without_one_command_is_tried_to_the_end(name):
    device = sound()
    token = KINDS[name].command.token.decode()
    device.flight.handlers.pop(token, None)
    device.commands_apart[token] = lambda: None
    assert [*Run(device).to().results] == NAMES


TEXTS = st.text(st.characters(exclude_categories=("Cs",)), max_size=30)
NUMBERS = st.one_of(
    st.sampled_from(["", "NaN", "inf", "-inf", "-0", "1e5", "0"]),
    st.integers(-(2**33), 2**33).map(str),
    st.floats().map(repr),
)


@settings(max_examples=10)
@given(
    st.dictionaries(
        st.sampled_from([one.name for one in REFERENCE.fields]),
        st.lists(st.one_of(NUMBERS, TEXTS), min_size=1, max_size=4),
        min_size=1,
        max_size=4,
    )
)
def test_a_device_with_any_texts_in_its_fields_is_tried_to_the_end(told):
    device = sound()
    every = {REFERENCE.index[field]: cycle(texts) for field, texts in told.items()}
    put_line = device.queue.put_line

    def changed(text, now):
        if text.startswith("$TELEM,"):
            mark, *texts = text.split(",")
            for place, told_there in every.items():
                texts[place] = next(told_there)
            text = ",".join([mark, *texts])
        put_line(text, now)

    device.queue.put_line = changed
    assert [*Run(device).to().results] == NAMES


@settings(max_examples=8)
@given(lines=st.lists(st.binary(max_size=90), min_size=1, max_size=5))
def test_a_device_that_sends_any_bytes_besides_is_tried_to_the_end(lines):
    device = sound()
    every, take = cycle(lines), device.queue.take

    def more(now):
        gone = take(now)
        return [next(every), *gone] if gone else []

    device.queue.take = more
    # What hides all of its telemetry is not found.
    assert [*Run(device).to().results] in (NAMES, [])


@settings(max_examples=6)
@given(cut=st.floats(0.0, 0.6), garbage=st.floats(0.0, 1.0), seed=st.integers(0, 99))
def test_a_cable_that_damages_lines_is_tried_to_the_end(cut, garbage, seed):
    run = Run(sound(cut=cut, garbage=garbage, seed=seed)).to()
    assert [*run.results] == NAMES


# -- what it must not do ------------------------------------------------------------------------


def sent_by(run):
    """The commands of the reference that were sent, by their names."""
    return {name for name, kind in KINDS.items() if kind.command.token in run.line.sent}


ARMS = {"key_arm", "key_disarm"}
WIPES = {"reset_fram", "wipe_flash", "wipe_fram_and_reboot"}
ASKS = {"heartbeat", "flash_info", "dump_fram", "dump_flash"}


@pytest.mark.parametrize("options", [(), (REBOOT,), (WIPE,)])
@pytest.mark.parametrize("risk", [Risk.NONE, Risk.ARMS])
def test_what_was_not_allowed_is_never_sent(risk, options):
    run = Run(sound(), risk, options).to()
    wanted = ASKS | (ARMS if risk is Risk.ARMS else set())
    wanted |= {"reboot"} if REBOOT in options else set()
    # The FRAM is filled while it is armed; an empty one is not reset.
    wanted |= WIPES if WIPE in options else set()
    wanted -= {"reset_fram"} if risk is Risk.NONE else set()
    assert sent_by(run) == wanted
    assert run.device.mode is ComputerMode.Startup
    assert not any(run.device.flight.flags.values())
    tried = [one for one in CLAUSES if run.results[one.name].verdict is not Verdict.NOT_TRIED]
    assert max(one.risk for one in tried) == risk


def test_what_it_changed_is_set_back():
    """Given a flight computer with a target."""
    device = sound()
    run = Run(device, Risk.NONE, ())
    run.to(lambda: bool(device.heartbeats))
    device.flight.target = (12.5, -70.25)
    run.to()
    assert run.results["target"].verdict is Verdict.PASSED
    assert device.flight.target == (12.5, -70.25)


MORE_THAN_ARMS = ["<L>", "<M>", "<S>", "<D>", "<d>", "<1>", "<A3>", "<W>", "<F>", "<X>", "<R>"]


@pytest.mark.parametrize("form", ["%s", "x%s", "(%s)", "%s%s", "<H>%s"])
@pytest.mark.parametrize("token", MORE_THAN_ARMS)
def test_a_trial_that_would_do_more_unasked_ends_in_our_own_error(token, form):
    bench = UmbilicalBench(REFERENCE, Risk.ARMS)
    bench.at(1.0)
    for text in (token, token[1:-1], token.swapcase()):
        data = form.replace("%s", text).encode()
        if data in (b"<m>", b"<s>", b"<f>"):
            continue  # closes a valve, or only asks
        with pytest.raises(NotAllowedError):
            next(bench.write(data))
    assert bench.take_output() == []


def test_two_writes_are_never_closer_than_the_receiver_can_take():
    """Given a flight computer that sleeps 0.1 s after each command."""
    device = sound()
    Run(device, Risk.NONE, ()).to()
    # What the kit writes wrong on purpose is all that is lost.
    assert {*device.receiver.lost} <= {"unknown", "glued"}


# -- how it is left -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("risk", "reached"),
    [
        (Risk.ARMS, lambda device: device.mode is ComputerMode.Standby),
        (Risk.FIRES, lambda device: device.flight.flags["mav_open"]),
        (Risk.FIRES, lambda device: device.flight.flags["sv_open"]),
        (Risk.FIRES, lambda device: device.mode is ComputerMode.Ascent),
    ],
)
def test_an_abort_leaves_it_safe(risk, reached):
    """Given a Ctrl-C while it is armed, a valve is open, or it is launched."""
    device = sound()
    run = Run(device, risk, ())
    run.to(lambda: bool(reached(device)))
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    assert device.mode is ComputerMode.Startup
    assert not device.flight.flags["mav_open"]
    assert not device.flight.flags["sv_open"]
    assert run.problem == "aborted by Ctrl-C"


def test_heartbeats_go_on_after_an_abort_in_a_while_without():
    """Given a Ctrl-C while it is tried how long the connection lasts."""
    device = sound()
    run = Run(device, Risk.ARMS, ())
    run.to(lambda: run.line.now - 100.0 > 15.0)
    assert run.line.now - device.heartbeats[-1] > 2.0
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    assert run.line.now - device.heartbeats[-1] < 1.0


def test_a_device_that_cannot_be_disarmed_is_named():
    device = sound()
    run = Run(device, Risk.ARMS, ())
    run.to(lambda: device.mode is ComputerMode.Standby)
    device.deaf = True
    run.session.abort("aborted by Ctrl-C", run.line.now)
    run.to()
    left = "the device: it is LEFT ARMED: flight mode Standby"
    assert run.problem.startswith(f"aborted by Ctrl-C; {left}")


def test_a_device_that_was_sent_nothing_that_arms_is_not_said_to_be_left_armed():
    """Given one that falls silent before the first such command, though it is allowed."""
    run = Run(sound()).silenced()
    assert "LEFT" not in run.problem


def test_a_device_that_vanishes_without_heartbeats_may_be_left_with_open_valves():
    """Given one that falls silent while it is tried how long the connection lasts: some open the
    SV then."""
    device = sound()
    run = Run(device, Risk.ARMS, ())
    run.to(lambda: not run.session.bench.beats)
    device.act("silent")
    run.to()
    assert "its valves open: no telemetry shows it" in run.problem


def test_a_device_whose_state_cannot_be_seen_is_named():
    """Given one that falls silent while a valve is open."""
    device = sound()
    run = Run(device)
    run.to(lambda: bool(device.flight.flags["sv_open"]))
    device.act("silent")
    run.to()
    assert "LEFT ARMED, and its valves open: no telemetry shows it" in run.problem
    assert not device.flight.flags["sv_open"], "closed all the same"


def test_a_device_that_falls_silent_is_not_blamed_for_what_follows():
    device = sound()
    run = Run(device, Risk.NONE, ())
    run.to(lambda: "unknown" in run.results)
    device.act("silent")
    run.to()
    assert run.of(Verdict.FAILED) == []
    told = "the device fell silent as brackets was tried"
    assert run.results["soak"].why == told
    assert run.problem.startswith(told)


def test_where_no_telemetry_is_received_nothing_is_tried():
    run = Run(device := sound())
    run.to(lambda: bool(device.heartbeats))
    device.act("silent")
    run.to()
    assert run.problem.startswith("no $TELEM line is received within 10 s (0 bytes were)")
    assert run.results == {}
    assert not any(isinstance(one, DeviceFound) for one in run.line.events)


def test_a_soak_of_a_device_that_starts_anew_fails():
    device = sound()
    clauses = [one for one in CLAUSES if one.needs == SOAK]
    bench = UmbilicalBench(REFERENCE, soak=30.0)
    run = Run(device, session=Session(bench, clauses, Allowed(options=(SOAK,))))
    run.to(lambda: run.line.now > 115.0)
    device.act("reboot")
    run.to()
    assert run.results["soak"].why == "without a command it restarted"
    assert not math.isnan(device.booted_at)
