"""Dumps and wipes: long works that pause the telemetry, and how each of them ends."""

import itertools

import pytest
from umbilical_link_bench import ASCENT, STANDBY, STARTUP, Bench, ready

from chute_ros.errors import ParameterError, TransitionError
from chute_ros.links.umbilical.protocol.config import MemoryLimits
from chute_ros.links.umbilical.protocol.events import (
    DumpData,
    DumpFinished,
    DumpStarted,
    WorkProgress,
)
from chute_ros.links.umbilical.protocol.memory import STEPS, WorkEvent, WorkStep
from chute_ros.transitions import after

CSV = b"time,mode\n1,2\n3,4\n"
BINARY = bytes(range(256)) * 3 + b"$TELEM,1,2\n---[INFO"
BEGIN = {"csv": "--- BEGIN FLASH CSV DUMP ---", "binary": "--- BEGIN FLASH BINARY DUMP ---"}
END = {"csv": "--- END FLASH CSV DUMP ---", "binary": "--- END FLASH BINARY DUMP ---"}
LASTING = ["dump_flash", "dump_fram", "wipe_flash", "wipe_fram_and_reboot"]


def dumped(bench):
    return b"".join(event.data for event in bench.of(DumpData))


def dumping(**rest):
    """A flash dump is under way; (bench, request)."""
    bench = ready(**rest)
    number = bench.order("dump_flash")
    bench.after(0.1).silent().hear(BEGIN["csv"])
    return bench, number


def wiping(name="wipe_flash"):
    bench = ready()
    number = bench.order(name)
    bench.after(0.1).silent().hear("Wiping QSPI Flash... Please wait.")
    return bench, number


def failed(bench, number, text):
    """The dump is over, and so is its request."""
    assert bench.of(DumpFinished) == [DumpFinished(number, False, text)]
    (end,) = bench.ends(number)
    assert (end.success, end.message) == (False, text)


def test_a_step_is_in_the_table_or_raises():
    for step, sign in itertools.product(WorkStep, WorkEvent):
        if (step, sign) == (WorkStep.SENT, WorkEvent.TOKEN_SENT):
            with pytest.raises(TransitionError, match="its token was sent"):
                after(STEPS, step, sign)
        else:
            began = sign is WorkEvent.FIRST_SIGN or step is WorkStep.BEGUN
            wanted = WorkStep.BEGUN if began else WorkStep.SENT
            assert after(STEPS, step, sign) is STEPS[step, sign] is wanted, (step, sign)


@pytest.mark.parametrize(("kind", "data"), [("csv", CSV), ("binary", BINARY)])
@pytest.mark.parametrize("piece", [1, 7, 64, 5000])
def test_a_dump_comes_through_byte_by_byte(kind, data, piece):
    bench = ready()
    number = bench.order("dump_flash")
    assert bench.tokens == ["<G>"]
    bench.after(0.1).silent().hear("[INFO] about to dump", BEGIN[kind])
    assert bench.of(DumpStarted) == [DumpStarted(number, "flash", f".{kind}")]
    raw = data + END[kind].encode() + b"\n"
    for start in range(0, len(raw), piece):
        bench.after(0.001).hear_bytes(raw[start : start + piece])
    assert dumped(bench) == data
    (over,) = bench.of(DumpFinished)
    assert over == DumpFinished(number, True, f"dump flash complete, {len(data)} bytes")
    end = bench.talk().after(1.0).end(number)
    assert (end.success, end.sent, end.shown, end.message) == (True, True, True, over.text)
    assert bench.steps(number) == ["SENT", "CONFIRMED"]


def test_a_long_dump_tells_how_far_it_is():
    bench, number = dumping()
    for _ in range(6):
        bench.after(0.5).hear_bytes(b"1,2,3,4,\n" * 15_000)
    bench.hear(END["csv"])
    # What may be the beginning of an end mark or of telemetry is counted when it is known.
    told = [event.done for event in bench.of(WorkProgress)]
    assert told == [pytest.approx(size, abs=10) for size in (270_000, 540_000, 810_000)]
    assert bench.end(number).message == "dump flash complete, 810000 bytes"


def test_a_dump_that_does_not_begin_is_given_up():
    for memory, token in (("flash", "<G>"), ("fram", "<f>")):
        bench = ready()
        number = bench.order(f"dump_{memory}")
        bench.after(4.9)
        assert bench.ends(number) == []
        end = bench.after(0.2).end(number)
        text = f"dump {memory} failed, 0 bytes: no sign of it within 5 s"
        assert (end.success, end.sent, end.message) == (False, True, text)
        assert bench.of(DumpStarted, DumpFinished) == []
        assert bench.after(9.0).tokens == [token]


def test_a_dump_that_falls_silent_is_given_up_with_what_came():
    bench, number = dumping()
    bench.hear_bytes(b"1,2\n-").after(2.9)
    assert bench.ends(number) == []
    bench.after(0.2)
    assert dumped(bench) == b"1,2\n-"
    failed(bench, number, "dump flash failed, 5 bytes: silent for 3 s, no end mark")
    # What is said after is read as lines again.
    records = bench.link.computer.records
    bench.talk().after(0.5)
    assert bench.link.computer.records > records


def test_a_dump_ends_when_telemetry_goes_on_the_cable_is_pulled_or_it_restarts():
    bench, number = dumping()
    bench.hear_bytes(b"1,2\n").after(0.5).talk().after(0.5)
    assert dumped(bench) == b"1,2\n"
    failed(bench, number, "dump flash failed, 4 bytes: no end mark before telemetry resumed")
    bench, number = dumping()
    bench.hear_bytes(b"1,2\n-").pull()
    assert dumped(bench) == b"1,2\n-"
    text = "dump flash failed, 5 bytes: the cable was pulled, or the port closed"
    failed(bench, number, text)
    bench.plug().after(0.3).hear("x", END["csv"]).talk().after(1.0)
    failed(bench, number, text)
    bench, number = dumping()
    bench.hear_bytes(b"1,2\n").after(0.5).restarts(flight_mode=STARTUP).after(0.5)
    assert not bench.end(number).success
    assert len(bench.of(DumpFinished)) == 1
    assert dumped(bench) == b"1,2\n"
    bench = ready()
    number = bench.order("dump_flash")
    bench.after(0.2).restarts(flight_mode=STARTUP).after(0.5)
    assert bench.end(number).message.endswith("the flight computer restarted"), "before its sign"


def test_a_dump_that_nobody_asked_for_is_followed():
    bench = ready().silent().hear(BEGIN["csv"]).hear_bytes(CSV).after(0.5)
    assert bench.of(DumpStarted) == [DumpStarted(0, "flash", ".csv")]
    number = bench.order("wipe_flash")
    assert bench.end(number).message == "wipe_flash refused: a dump flash is in progress"
    bench.hear(END["csv"])
    assert bench.of(DumpFinished)[0].complete
    assert dumped(bench) == CSV
    assert bench.tokens == []


def test_dumps_that_nobody_asked_for_are_not_followed_without_end():
    """It may be noise on the wire; a while later it is looked at again."""
    bench = ready().silent()
    for kind in ("csv", "csv"):
        bench.hear(BEGIN[kind]).hear_bytes(CSV).hear(END[kind])
    assert len(bench.of(DumpStarted)) == len(bench.of(DumpFinished)) == 1
    assert dumped(bench) == CSV
    bench.after(60.0).hear(BEGIN["csv"]).hear_bytes(CSV).hear(END["csv"])
    assert len(bench.of(DumpFinished)) == 2


SNAP = ["SNAP seq=1 mode=2", "Snapshot: alt=3", "FRAM end"]


def test_a_fram_dump_is_lines_until_telemetry_goes_on():
    bench = ready()
    number = bench.order("dump_fram")
    bench.after(0.05).silent().hear(*SNAP)
    assert bench.of(DumpStarted) == [DumpStarted(number, "fram", ".txt")]
    bench.talk().after(0.2)
    data = "".join(f"{text}\n" for text in SNAP).encode()
    assert dumped(bench) == data
    assert bench.of(DumpFinished)[0].complete
    assert bench.end(number).message == f"dump fram complete, {len(data)} bytes"
    assert bench.tokens == ["<f>"]


def test_a_fram_dump_is_over_when_no_more_lines_come():
    bench = ready()
    number = bench.order("dump_fram")
    bench.silent().after(0.1).hear(SNAP[0]).after(0.9).hear(SNAP[1]).after(0.9)
    assert bench.ends(number) == []
    assert bench.after(0.2).end(number).success


def test_lines_of_the_fram_that_nobody_asked_for_are_told():
    bench = ready().hear("SNAP seq=9")
    assert bench.notices() == ["flight computer: SNAP seq=9"]
    assert bench.of(DumpStarted) == []


def test_a_wipe_tells_its_progress_and_its_end():
    bench, number = wiping()
    bench.after(20.0).hear("Wipe progress: 100/2048 sectors").after(50.0)
    bench.hear("Wipe progress: 2048/2048 sectors").after(1.0)
    assert bench.ends(number) == []
    bench.hear("Flash wiped successfully.")
    assert [(e.done, e.total) for e in bench.of(WorkProgress)] == [(100, 2048), (2048, 2048)]
    assert bench.end(number).message == "wipe flash complete: Flash wiped successfully."
    assert bench.steps(number) == ["SENT", "CONFIRMED"]
    assert bench.tokens == ["<W>"]


def test_a_wipe_that_fails_falls_silent_or_whose_end_was_lost_says_so():
    for text in ("ERASE FAILED!", "ERASE TIMEOUT!"):
        bench, number = wiping()
        end = bench.after(1.0).hear(text).end(number)
        assert (end.success, end.message) == (False, f"wipe flash failed: {text}")
    bench, number = wiping()
    end = bench.after(9.0).talk().after(0.3).end(number)
    assert not end.success
    assert end.message == "wipe flash failed: telemetry resumed, but its end was not reported"
    bench, number = wiping()
    bench.after(59.0).hear("Wipe progress: 1/2 sectors").after(59.0)
    assert bench.ends(number) == []
    assert bench.after(1.1).end(number).message == "wipe flash failed: silent for 60 s"


@pytest.mark.parametrize("said", ["Flash wiped successfully.", "ERASE FAILED!"])
def test_the_end_of_a_wipe_of_which_nothing_is_known_is_told(said):
    assert ready().hear(said).notices() == [f"flight computer: {said}"]
    bench, number = dumping()
    bench.hear(END["csv"], said)
    assert f"flight computer: {said}" in bench.notices()
    assert bench.end(number).success


def test_its_limits_are_times():
    for name in ("answer_within", "dump_silence", "wipe_silence", "fram_quiet"):
        for value in (0.0, -1.0, float("inf"), float("nan")):
            with pytest.raises(ParameterError) as raised:
                MemoryLimits(**{name: value})
            told = f"{name} is {value}: need a number (1.0, not 1) from 0.1 to "
            assert told in str(raised.value)


def test_a_wipe_by_somebody_else_is_followed():
    bench = ready().silent().hear("Wiping QSPI Flash... Please wait.").after(40.0)
    number = bench.order("safe")
    bench.hear("Flash wiped successfully.").talk().after(0.5)
    assert "wipe flash complete: Flash wiped successfully." in bench.notices()
    assert bench.end(number).success


def test_wiping_the_fram_and_rebooting_is_done_when_it_restarts_and_not_before():
    for said in ("Flash wiped successfully.", "ERASE FAILED!"):
        bench, number = wiping("wipe_fram_and_reboot")
        bench.after(20.0).hear(said).after(2.0)
        assert bench.ends(number) == []
        bench.restarts(flight_mode=STARTUP).after(0.3)
        assert bench.end(number).success
        assert bench.tokens == ["<X>"]
    bench = ready()
    number = bench.order("wipe_fram_and_reboot")
    bench.after(0.5).silent().after(2.0).restarts(flight_mode=STARTUP).after(0.5)
    assert bench.end(number).message == "wipe fram and reboot complete", "without a word"
    bench, number = wiping("wipe_fram_and_reboot")
    bench.after(1.0).hear("Flash wiped successfully.").talk().after(59.0)
    assert bench.ends(number) == []
    assert not bench.after(2.0).end(number).success


def test_a_second_work_is_refused_while_one_is_under_way():
    for first, second in itertools.product(LASTING, LASTING):
        bench = ready()
        one, two = bench.order(first), bench.order(second)
        text = f"{second} refused: a {first.replace('_', ' ')} is sent, no sign of it yet"
        assert bench.end(two).message == text
        assert bench.ends(one) == []
        assert len(bench.after(1.0).tokens) == 1, text


def test_after_one_is_over_the_next_can_begin():
    bench, first = dumping()
    bench.hear(END["csv"])
    assert bench.end(first).success
    second = bench.talk().after(0.2).order("dump_flash")
    bench.silent().after(0.2).hear(BEGIN["csv"]).hear_bytes(CSV).hear(END["csv"])
    assert bench.end(second).success
    assert bench.tokens == ["<G>", "<G>"]


def test_one_that_waits_gives_way_to_one_that_somebody_else_began():
    bench = ready()
    bench.order("flash_info")
    number = bench.order("dump_fram")
    bench.hear(BEGIN["csv"])
    assert "has begun a dump flash instead" in bench.end(number).message
    bench.hear(END["csv"]).after(3.0)
    assert bench.tokens == ["<I>"]  # what was told to have failed is not asked for


def test_a_wipe_that_somebody_else_ends_before_ours_was_sent_is_not_begun_again():
    bench = ready()
    bench.order("flash_info")
    number = bench.order("wipe_flash")
    bench.hear("Wiping QSPI Flash... Please wait.", "Flash wiped successfully.").after(3.0)
    assert len(bench.ends(number)) == 1
    assert bench.tokens == ["<I>"]


def test_one_that_never_has_its_turn_is_given_up_and_does_not_leave():
    for name in LASTING:
        bench = Bench(always_alive=True, memory=MemoryLimits(answer_within=0.1))
        bench.talk(flight_mode=STANDBY).at(1.05)
        bench.order("flash_info")
        number = bench.order(name)
        end = bench.after(0.11).end(number)
        assert "not sent within 0.1 s: the wire is busy or closed" in end.message, name
        assert not end.sent
        assert bench.after(3.0).tokens == ["<I>"]


def test_in_flight_it_is_refused_unless_forced():
    for name in LASTING:
        bench = ready(ASCENT)
        refused, forced = bench.order(name), bench.order(name, force=True)
        assert "flight mode Ascent" in bench.end(refused).message, name
        assert bench.ends(forced) == []
        assert len(bench.tokens) == 1
