"""A body that flies its tape until our side acts."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path

import pytest
from campaign_bench import FOLDER, fired, scenario

from chute_ros.campaign.draw import draw
from chute_ros.campaign.flight import Flight, Flown
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.scenario import Failure, Scenario, Stop, is_rocket
from chute_ros.campaign.scenario_text import scenario_of, text_of
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.taped import RealSensors, TapedAutopilot, TapedModel, truth_of
from chute_ros.campaign.tapes import TapeFile, Tapes, on_tape
from chute_ros.errors import RecordError
from chute_ros.model import Action
from chute_ros.sim.autopilot_kinds import GENERIC
from chute_ros.sim.tape import GRAINS, MAGIC, STEP, Label, Tape, pack, written


def tape(name: str, sink: float, lasts: float = 12.0, **more: object) -> Tape:
    """It hovers at 80 m with its nose up by 0.2 rad, and sinks so fast (m/s) from 2 s on."""
    rows = [dict.fromkeys(GRAINS, 0.0)]
    height = 80.0
    while height > 0.0 and len(rows) * STEP < lasts:
        falls = len(rows) * STEP >= 2.0
        speed = -sink * min(1.0, len(rows) * STEP - 2.0) if falls else 0.0
        height += speed * STEP
        row = {"height": height, "vertical_speed": speed, "force": 9.8, "pitch": 0.2}
        told = {"commanded_pitch": 0.2, "commanded_height": 80.0, "commanded_thrust": 0.6}
        rows.append({**dict.fromkeys(GRAINS, 0.0), **row, **told})
    rows[0] = rows[1]
    columns = {name: [row[name] for row in rows] for name in GRAINS}
    label = Label(name, "physics 1", "multirotor", "its thrust", **more)  # type: ignore[arg-type]
    return Tape(label, len(rows), tuple(GRAINS), pack(columns))


LOST = {"failed_at": 2.0, "lost_at": 2.0, "shows_at": 2.6, "ends_hard": True, "level": True}
FALLS, FLIES = tape("falls", 12.0, **LOST), tape("flies", 0.0)


@pytest.fixture(name="file")
def of_both(tmp_path: Path) -> TapeFile:
    path = tmp_path / "some.tapes"
    path.write_bytes(MAGIC + written(FALLS) + written(FLIES))
    return TapeFile(path, only=True)


def on(one: Tape, **more: object) -> Scenario:
    """In still air, and nothing else goes wrong."""
    return on_tape(scenario(Failure.NOTHING, **more), one, _Calm())


class _Calm(random.Random):
    def random(self) -> float:
        return 0.0


def flown(file: TapeFile, drawn: Scenario) -> tuple[Flight, Flown]:
    flight = Flight(drawn, Shipped(FOLDER, file))
    return flight, flight.run()


def test_what_sinks_on_its_tape_is_released_from_where_the_tape_was(file: TapeFile) -> None:
    # Given a tape that sinks with 12 m/s from 2 s on
    flight, one = flown(file, on(FALLS))
    assert judge(one).count is Count.CORRECT
    assert one.truth.at == pytest.approx(one.up + 2.0, abs=STEP)
    assert one.up + 2.6 < one.killed < one.released < one.truth.latest
    # Until the kill it is where the tape is: 2 s, one of them to reach its sink
    passed = one.killed - one.up
    fallen = 12.0 * (passed - 2.5)
    assert 80.0 - fallen == pytest.approx(one.release_height, abs=12.0)
    model = flight.rig.model  # type: ignore[attr-defined]
    assert not model.plays
    assert one.landing_speed < 6.5 or math.isnan(one.landed)


def test_what_flies_on_its_tape_is_left_alone_to_its_end(file: TapeFile) -> None:
    _, one = flown(file, on(FLIES))
    assert judge(one).count is Count.CORRECT
    assert fired(one) == []
    assert not one.truth.falls


def test_an_autopilot_that_restarts_ends_the_tape_as_it_ends_any_flight(file: TapeFile) -> None:
    # Given a tape that flies, and an autopilot that starts anew at t+1
    restart = Stop("autopilot", 1.0, 0.5, dies=True)
    _, one = flown(file, replace(on(FLIES), faults=(restart,)))
    # then it falls from t+1.5, and that is the truth
    assert one.truth.at == pytest.approx(one.up + 1.5, abs=0.1)
    assert Action.DEPLOY in [act.decision.action for act in fired(one)]


def test_the_autopilot_tells_attitude_and_commands_of_the_tape() -> None:
    model = TapedModel(tape=FALLS, armed=True, height=80.0)
    sensors = RealSensors(random.Random(1), model)
    autopilot = TapedAutopilot(model, sensors, GENERIC)
    autopilot.update(0.0)
    autopilot.act("arm")
    model.begin()
    for _ in range(round(3.0 / STEP)):
        model.step(STEP)
    assert model.plays
    assert model.height < 76.0
    assert model.lean == pytest.approx(0.2, abs=0.001)
    assert autopilot._attitude().pitch == pytest.approx(0.2, abs=0.001)
    target = autopilot._attitude_target()
    assert 2.0 * math.asin(target.q[2]) == pytest.approx(0.2, abs=0.001)
    assert target.thrust == pytest.approx(0.6, abs=0.01)
    place = autopilot._position_target()
    assert (place.z, place.vz) == (pytest.approx(-80.0, abs=0.02), 0.0)
    wing = autopilot._nav_controller_output()
    assert wing.nav_pitch == pytest.approx(math.degrees(0.2), abs=0.1)
    assert wing.alt_error == pytest.approx(80.0 - model.height, abs=0.1)


def test_a_model_that_was_disarmed_before_does_not_begin() -> None:
    model = TapedModel(tape=FALLS, armed=False, height=80.0)
    model.begin()
    assert not model.plays


def test_a_canopy_on_the_tape_tells_the_latest_release() -> None:
    # Given a sink of 12 m/s: 80 m last until 9.2 s; a canopy opens within 1.2 s
    truth = truth_of(TapedModel(tape=FALLS), 10.0)
    assert truth.at == 12.0
    assert truth.height == pytest.approx(80.0, abs=0.1)
    assert 10.0 + 6.5 < truth.latest < 10.0 + 8.2
    assert not truth.lands_softly


def test_what_is_lost_and_ends_softly_needs_no_release() -> None:
    soft = replace(FALLS, label=replace(FALLS.label, ends_hard=False))
    assert truth_of(TapedModel(tape=soft), 0.0).lands_softly


def test_real_sensors_are_wrong_by_a_little_and_more_in_the_wind() -> None:
    model = TapedModel(tape=FALLS, armed=True, height=80.0)
    errors = []
    for speed in (0.0, 30.0):
        model.ground_speed, worst = speed, 0.0
        for seed in range(20):
            sensors = RealSensors(random.Random(seed), model)
            worst = max(worst, *(abs(sensors.read("pressure", 80.0, t) - 80.0) for t in range(9)))
        errors.append(worst)
    # A port error of 0.12 of the dynamic pressure at 30 m/s is 5.5 m.
    assert errors[0] < 3.0 < errors[1] < 9.0
    sensors = RealSensors(random.Random(1), model)
    # An estimator follows: what was at rest and moves at once is told late.
    sensors.read("speed", 0.0, 20.0)
    assert sensors.read("speed", -10.0, 20.02) > -9.0
    assert sensors.read("speed", -10.0, 20.9) == pytest.approx(-10.0, abs=1.0)


def test_flights_are_drawn_onto_tapes_of_their_profile(file: TapeFile) -> None:
    only, half = Tapes(file), Tapes(replace(file, only=False))
    taped = {True: 0, False: 0}
    for seed in range(200):
        plain = draw(seed)
        one, again, some = only.drawn(plain), only.drawn(plain), half.drawn(plain)
        assert one == again
        assert (one.tape is not None) is (plain.profile == "multirotor")
        if plain.profile == "multirotor":
            taped[some.tape is not None] += 1
            assert (one.manoeuvre, one.descent, one.ground, one.gusts) == (None, None, 0.0, 0.0)
            assert one.height == pytest.approx(80.0, abs=0.02)
        if is_rocket(plain.vehicle):
            assert one == plain
    assert min(taped.values()) > 25


def test_other_faults_lie_around_the_failure_of_the_tape(file: TapeFile) -> None:
    given = Stop("supervisor", 1.0, 0.5)
    plain = scenario(Failure.MOTOR, given, failure_at=1.5)
    for seed in range(20):
        one = on_tape(plain, FALLS, random.Random(seed))
        assert one.failure_at == 2.0
        assert [fault.at for fault in one.faults if isinstance(fault, Stop)] in (
            *([], [1.5], [pytest.approx(2.1)]),
        )


def test_a_flight_on_a_tape_is_stored_with_its_name_and_needs_its_file(file: TapeFile) -> None:
    stored, _ = scenario_of(text_of(on(FALLS), "MISSED"), "x")
    assert stored == on(FALLS)
    assert stored.tape is not None
    assert (stored.tape.name, stored.tape.failed) == ("falls", "its thrust")
    with pytest.raises(RecordError, match="no file with the tape 'falls' was given"):
        Flight(stored, Shipped(FOLDER))
    other = replace(stored, tape=replace(stored.tape, name="unheard"))
    with pytest.raises(RecordError, match="no tape 'unheard'"):
        Flight(other, Shipped(FOLDER, file))


def test_two_tapes_of_one_name_are_a_mistake(tmp_path: Path) -> None:
    path = tmp_path / "twice.tapes"
    path.write_bytes(MAGIC + written(FALLS) * 2)
    with pytest.raises(RecordError, match="two tapes are named 'falls'"):
        Tapes(TapeFile(path))
