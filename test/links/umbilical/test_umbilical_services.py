"""The services of umbilical, end to end: commands by name, the target, dumps, the supervisor."""

import os
from pathlib import Path

import pytest
from chute_msgs.msg import ActionReport, SafetyDecision, Telem
from chute_msgs.srv import Dump, SetTarget
from node_bench import stamped
from umbilical_bench import PATIENT, RATE, Cable

from chute_ros.links.umbilical.dump_files import PART
from chute_ros.links.umbilical.protocol import events
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.model import Action, Outcome
from chute_ros.ros import qos

#: Name -> (token, what telemetry then says; None: it cannot show it).
SIMPLE = {
    "safe": ("<V>", {"mav_open": 0, "sv_open": 0}),
    "key_arm": ("<KA>", {"flight_mode": Telem.STANDBY}),
    "key_disarm": ("<KD>", {"flight_mode": Telem.STARTUP}),
    "open_mav": ("<M>", {"mav_open": 1}),
    "close_mav": ("<m>", {"mav_open": 0}),
    "open_sv": ("<S>", {"sv_open": 1}),
    "close_sv": ("<s>", {"sv_open": 0}),
    **{f"payload_n{n}": (f"<{n}>", {f"cmd_n{n}": 1}) for n in (1, 2, 3, 4)},
    **{f"payload_a{n}": (f"<A{n}>", {f"cmd_a{n}": 1}) for n in (1, 2, 3)},
    "reset_fram": ("<F>", None),
}


@pytest.fixture
def cable(bench):
    one = Cable(bench, **PATIENT)
    one.plugged()
    return one


def test_each_command_by_its_name_with_the_effect_that_telemetry_shows(cable):
    tokens = []
    for name, (token, shown) in SIMPLE.items():
        answer = cable.command(name)
        assert answer.success, answer.message
        assert answer.sent, name
        assert answer.confirmed == (shown is not None), name
        tokens.append(token)
        cable.bench.until(lambda: cable.tokens() == tokens, f"{name} came, once")
        for field, value in (shown or {}).items():
            cable.await_telemetry(
                lambda t, f=field, v=value: getattr(t, f) == v, f"{field} {value}"
            )
        assert shown is not None or "telemetry cannot show its effect" in answer.message
    assert cable.computer.receiver.lost == {}
    answer = cable.command("heartbeat")
    assert (answer.success, answer.sent, answer.confirmed) == (True, True, False)


def test_a_wipe_lasts_and_its_progress_is_told(bench):
    settings = FlightComputerSettings(rate=RATE, wipe_time=1.0, wipe_sectors=8, interlock=True)
    cable = Cable(bench, settings, **PATIENT)
    cable.plugged()
    answer = cable.arm()
    assert not answer.success
    assert "Arming blocked: wipe flash first" in answer.message
    answer = cable.command("wipe_flash")
    assert (answer.success, answer.confirmed) == (True, True), answer.message
    assert "Flash wiped successfully." in answer.message
    assert cable.arm().success


def test_a_command_whose_effect_does_not_show_is_sent_but_not_confirmed(bench):
    cable = Cable(bench)
    cable.plugged()
    cable.act("mute")
    answer = cable.command("open_mav")
    assert (answer.success, answer.sent, answer.confirmed) == (False, True, False)
    assert "never showed that telemetry reports mav_open 1" in answer.message
    answer = cable.command("payload_n1")
    assert "sent once, but" in answer.message, "an event is never repeated"


def test_set_target_with_two_floats(cable):
    for *target, why in (
        (90.1, 0.0, "latitude 90.1 is out of range: need -90 to 90"),
        (1.0, 2.0, 3.0, "takes 2 floats (latitude and longitude), not 4"),
    ):
        answer = cable.set_target(*target)
        assert (answer.success, answer.sent, answer.confirmed) == (False, False, False), target
        assert why in answer.message
    answer = cable.set_target(42.4419130, -76.4878000)
    assert (answer.success, answer.sent, answer.confirmed) == (True, True, True), answer.message
    assert cable.tokens() == ["<T,42.4419130,-76.4878000>"]
    one = cable.await_telemetry(lambda t: t.blims_target_lat_deg > 40.0, "it is told")
    assert one.blims_target_lon_deg == pytest.approx(-76.4878, abs=1e-5)
    # Without a word of the other two.
    answer = cable.bench.call(SetTarget, "umbilical/set_target", latitude=42.5, longitude=-76.5)
    assert answer.confirmed, answer.message


def test_set_target_with_four_floats(bench):
    cable = Cable(bench, sends="telem54", **PATIENT)
    cable.plugged()
    answer = cable.set_target(42.5, -76.5, 42.25, -76.25)
    assert answer.confirmed, answer.message
    one = cable.await_telemetry(lambda t: t.blims_upwind_lat_deg == 42.5, "it is told")
    assert one.blims_downwind_lon_deg == -76.25


@pytest.mark.parametrize("binary", [False, True], ids=["CSV", "binary"])
def test_a_flash_dump_becomes_a_file_of_exactly_its_bytes(bench, binary):
    settings = FlightComputerSettings(rate=RATE, binary_dump=binary, dump_size=20_000)
    cable = Cable(bench, settings, **PATIENT)
    cable.plugged()
    answer = cable.dump("flash")
    assert answer.success, answer.message
    written = Path(answer.path_written)
    assert written.parent == bench.folder / "dumps"
    assert written.suffix == (".binary" if binary else ".csv")
    data = written.read_bytes()
    assert len(data) == answer.size > 20_000 - 1
    assert cable.call(lambda computer: computer.memory.content()) == data
    beats = [b.link_state for b in cable.heartbeats[-3:]]
    assert set(beats) == {1}, "the pause is not taken for a lost link"


def test_a_dump_goes_where_it_is_told_to(cable):
    path = cable.bench.folder / "flight 7.csv"
    answer = cable.dump("flash", str(path))
    assert (answer.success, answer.path_written) == (True, str(path)), answer.message
    assert path.stat().st_size == answer.size > 0
    answer = cable.dump("flash", "flight 8.csv")
    assert answer.path_written == str(cable.bench.folder / "dumps" / "flight 8.csv"), "relative"
    again = cable.dump("flash", str(path))
    assert not again.success
    assert "exists already: name another path" in again.message
    assert cable.tokens().count("<G>") == 2


def test_a_dump_that_cannot_be_is_refused(cable):
    for memory, path, why in (
        ("disk", "", "memory 'disk': need one of flash, fram"),
        ("flash", "/nowhere/at/all.csv", "there is no folder /nowhere/at"),
    ):
        answer = cable.dump(memory, path)
        assert (answer.success, answer.path_written, answer.size) == (False, "", 0)
        assert why in answer.message
    assert cable.tokens() == []


def test_a_disk_that_is_full_is_told(cable):
    assert os.path.exists("/dev/full"), "this machine has no /dev/full to write to"
    answer = cable.dump("flash", "/dev/full/dump.csv")
    assert not answer.success
    assert "/dev/full" in answer.message


def test_a_fram_dump_is_the_lines_that_came(cable):
    cable.arm()
    cable.await_telemetry(lambda t: t.device_uptime > 2.0, "it has stored a snapshot")
    answer = cable.dump("fram")
    assert answer.success, answer.message
    assert Path(answer.path_written).read_text().startswith("SNAP seq=")


def test_a_dump_without_its_end_mark_keeps_its_part(cable):
    cable.act("lose-dump-end")
    answer = cable.dump("flash")
    assert not answer.success
    assert "no end mark before telemetry resumed" in answer.message
    assert answer.path_written.endswith(f".csv{PART}")
    assert Path(answer.path_written).stat().st_size == answer.size > 0


def test_a_node_that_ends_in_a_dump_keeps_what_has_come(bench):
    settings = FlightComputerSettings(rate=RATE, dump_size=200_000, dump_rate=200.0)
    cable = Cable(bench, settings, **PATIENT)
    cable.plugged()
    bench.ask(Dump, "umbilical/dump", memory="flash")
    (part,) = bench.until(lambda: list((bench.folder / "dumps").glob(f"*{PART}")), "it has begun")
    # More may come behind it until the link's thread has ended.
    waits = events.DumpData(b"what came last and waits")
    cable.node.inbox.put([waits])
    bench.remove(cable.node)
    assert waits.data in part.read_bytes()


@pytest.fixture
def decide(bench):
    """Publish a decision as the supervisor would; its last report."""
    reports = bench.follow(ActionReport, "safety/action", qos.DECISION)
    numbers = iter(range(1, 100))

    def publish(action, *reasons):
        number = next(numbers)
        message = SafetyDecision(
            epoch=1, id=number, action=int(action), rule="test", targets=["umbilical"]
        )
        message.reasons = list(reasons)
        bench.publish(stamped(bench.client, message), "safety/decision", qos.DECISION)
        ended = (Outcome.CONFIRMED, Outcome.FAILED)
        return bench.until(
            lambda: next((r for r in reports if r.id == number and r.outcome in ended), None),
            "it is reported",
        )

    return publish


def test_a_kill_is_the_vehicle_made_safe(cable, decide):
    assert cable.command("open_mav").confirmed
    report = decide(Action.KILL, "a test")
    assert report.outcome == Outcome.CONFIRMED, report.detail
    assert "mav_open 0" in report.detail
    assert cable.tokens() == ["<M>", "<V>"]


def test_after_a_kill_or_while_flight_is_blocked_nothing_launches(cable, decide):
    for action, reason, told in (
        (Action.KILL, "a test", "killed: a test"),
        (Action.FLIGHT_BLOCK, "a link is silent", "a link is silent"),
    ):
        cable.act("jump=Startup")
        cable.await_mode(Telem.STARTUP)
        assert cable.arm().success
        assert decide(action, reason).outcome == Outcome.CONFIRMED
        answer = cable.command("launch", force=True)
        assert not answer.sent
        assert f"launch refused: flight is blocked ({told})" in answer.message
        answer = cable.command("open_mav")
        assert f"open_mav refused: flight is blocked ({told})" in answer.message
        assert decide(Action.FLIGHT_BLOCK_RELEASE).outcome == Outcome.CONFIRMED
        assert cable.command("launch", force=True).confirmed


def test_a_decided_deploy_on_the_ground_is_sent_where_that_is_wished(bench, decide):
    cable = Cable(bench, **{**PATIENT, "decided_deploy_forces": True})
    cable.plugged()
    assert decide(Action.DEPLOY).outcome == Outcome.CONFIRMED
    assert cable.tokens() == ["<D>"]


def test_what_a_deploy_fires_is_a_parameter(bench, await_until):
    cable = Cable(bench, deploy_stage="next", **PATIENT)
    cable.plugged()
    cable.act("jump=Coast")
    cable.await_mode(Telem.COAST)

    def fires(expected):
        answer = cable.deploy()
        assert answer.success, answer.message
        return cable.tokens()[-1] == expected

    assert fires("<D>")
    # The drogue has its time to open; until then it is out already.
    await_until(lambda: fires("<d>"), "the main is fired")
    assert "already; nothing was sent" in cable.deploy().message
    assert cable.tokens() == ["<D>", "<d>"]


def test_a_deploy_that_is_forced_fires_again(cable):
    cable.act("jump=Coast")
    cable.await_mode(Telem.COAST)
    assert cable.deploy().success
    assert cable.deploy(force=True).success
    assert cable.tokens() == ["<D>", "<D>"]
