"""What must always hold, whatever the profile, the settings and the inputs (invariants.py)."""

import dataclasses
import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from invariants import Watch, reports_of
from story import FLYING_WELL, LINK, Story, parachute, shipped, vehicle

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome, VehicleState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum, Clears, Profile, Rule
from chute_ros.supervisor.yaml_lines import ALL, ANY

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
SIGNS = {
    "vertical_speed": (-30.0, -14.0, -3.0, 0.0, 3.0, 14.0),
    "height": (-5.0, 0.0, 5.0, 50.0, 130.0),
    "tilt": (0.0, 30.0, 70.0, 170.0),
    "acceleration": (0.0, 3.0, 9.8, 30.0),
    "battery_remaining": (0.0, 0.04, 0.5, 1.0),
    "latitude": (48.0, 48.01, 95.0),
}
JUDGED = st.lists(st.sampled_from(LinkJudgement), min_size=1, max_size=3).map(tuple)
LINKS = st.sampled_from([ANY, ALL, LINK, UPF])
WEIGHTS = st.sampled_from([1e-3, 0.5, 1.0, 2.0])
NAMES = ("vertical_speed", "height", "tilt_deg", "acceleration", "distance_from_home")
CONDITIONS = st.one_of(
    st.builds(
        MeasurementCondition,
        st.sampled_from(NAMES),
        st.sampled_from([math.nan, -100.0, 0.0, 10.0, 60.0]),
        st.sampled_from([math.nan, -12.0, 2.0, 5.0]),
        WEIGHTS,
    ),
    st.builds(LinkCondition, LINKS, JUDGED, WEIGHTS),
    st.builds(AutopilotCondition, st.sampled_from(AutopilotFact), WEIGHTS),
    st.builds(DeviceCondition, st.sampled_from(DeviceFact), st.sampled_from([ANY, UPF]), WEIGHTS),
)
ACTIONS = st.sampled_from([Action.NONE, Action.FLIGHT_BLOCK, K, D, D, D])
IN_FLIGHT = (Stage.IN_FLIGHT, Stage.KILLING)
STATES = st.one_of(
    st.just(IN_FLIGHT), st.just(tuple(Stage)), st.lists(st.sampled_from(Stage)).map(tuple)
)
RULES = st.builds(
    Rule,
    st.just("named later"),
    st.lists(CONDITIONS, min_size=1, max_size=3).map(tuple),
    ACTIONS,
    STATES,
    needed=st.sampled_from([1e-3, 0.5, 1.0, 2.0, 3.0]),
    hold=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    leak=st.sampled_from([0.0, 0.5, 1.0]),
    samples=st.integers(1, 3),
    clears=st.sampled_from(Clears),
)


def _profile(rules: list[Rule], **others: Any) -> Profile:
    named = tuple(dataclasses.replace(one, name=f"rule {n}") for n, one in enumerate(rules))
    return Profile("random", named, **others)


PROFILES = st.builds(
    _profile,
    st.lists(RULES, min_size=1, max_size=4),
    minimum_height=st.sampled_from([0.0, 10.0, 60.0]),
    below_minimum=st.sampled_from(BelowMinimum),
    moving_speed=st.sampled_from([0.1, 2.0, 20.0]),
    landed_hold=st.sampled_from([0.0, 0.3, 5.0]),
    low_height=st.sampled_from([0.0, 30.0, 70.0]),
)
CONFIGS = st.builds(
    SupervisorConfig,
    deploy_links=st.just((LINK, UPF)),
    deploy_ladder=st.sampled_from([(), (Rung(UPF, "trigger"),), (Rung(LINK), Rung(LINK, "2"))]),
    kill_to_deploy_delay=st.sampled_from([0.0, 0.5, 3.0]),
    low_kill_to_deploy_delay=st.sampled_from([0.0, 0.2, 5.0]),
    ladder_step_timeout=st.sampled_from([0.3, 2.0]),
    require_vehicle_state=st.booleans(),
    profile=st.one_of(PROFILES, st.sampled_from([shipped("multirotor").profile])),
)

# -- what comes ----------------------------------------------------------------------------------

AGES = st.sampled_from([0.0, 0.0, 0.0, 0.1, 0.8, 3.0, math.nan, -1.0, math.inf])
WILD = st.builds(
    VehicleState,
    armed=st.sampled_from(Armed),
    landed_state=st.sampled_from(LandedState),
    link_state=st.sampled_from(LinkState),
    system_status=st.sampled_from([0, 4, 6]),
    reboot_count=st.integers(0, 2),
    rebooted_in_flight=st.booleans(),
    **{name: st.sampled_from([*values, math.nan]) for name, values in SIGNS.items()},
    **{
        f"{name}_age": AGES
        for name in ("armed", "landed_state", "height", "vertical_speed", "attitude", "battery")
    },
    acceleration_age=AGES,
    position_age=AGES,
    longitude=st.just(11.0),
)
#: The same vehicle flies well but for one or two signs, again and again.
SIGN = st.sampled_from([(name, value) for name, values in SIGNS.items() for value in values])
LIES = st.sampled_from(
    [{}, {}, {"armed": Armed.DISARMED}, {"landed_state": LandedState.ON_GROUND}]
)
TOLD = st.builds(
    lambda signs, lie, count: ("told", {**FLYING_WELL, **dict(signs), **lie}, count),
    st.lists(SIGN, max_size=2),
    LIES,
    st.integers(1, 12),
)
REPORTED = st.tuples(
    st.just("reported"),
    st.sampled_from([K, D]),
    st.sampled_from(Outcome),
    st.sampled_from([LINK, UPF]),
)
WIRES = st.sampled_from([LINK, UPF])
OTHER = st.one_of(
    st.builds(i.VehicleReport, WILD),
    st.builds(
        i.LinkHeartbeat, WIRES, st.sampled_from(LinkState), st.booleans(), st.integers(0, 9)
    ),
    st.builds(parachute, WIRES, st.sampled_from(["1", "2"]), st.booleans(), st.just(())),
    st.just(i.KillRequest(0, "upf_can 33", "about to launch")),
)
PERSON = st.one_of(
    st.builds(i.KillRequest, st.just(1), st.just("operator"), st.just("stop")),
    st.builds(i.DeployRequest, st.just(2), st.booleans(), st.just("it falls")),
    st.builds(i.ResetRequest, st.just(3)),
    st.builds(i.ModeRequest, st.just(4), st.sampled_from(i.Mode), st.booleans()),
)
WAITS = st.sampled_from([0.0, 0.02, 0.1, 0.3, 1.0, 3.0, 12.0])
GOES = st.one_of(TOLD, TOLD, REPORTED, OTHER, PERSON, WAITS, st.just("restart"))


def run(watch: Watch, goes: list[Any]) -> None:
    """What came, one after the other, a little apart."""
    for one in goes:
        watch.wait(0.013)
        if isinstance(one, float):
            watch.wait(one)
        elif one == "restart":
            watch.restart()
        elif not isinstance(one, tuple):
            watch.feed(one)
        elif one[0] == "reported":
            watch.feed(*reports_of(watch, *one[1:]))
        else:
            for n in range(one[2]):
                seq = watch.state.evidence(LINK).seq + 1
                beat = i.LinkHeartbeat(LINK, LinkState.OK, True, seq)
                parts = {k: v + 1e-9 * n if type(v) is float else v for k, v in one[1].items()}
                watch.feed(beat, vehicle(**parts))
                watch.wait(0.1)


def begun(config: SupervisorConfig, flying: bool) -> Watch:
    watch = Watch(config)
    if flying:
        story = Story(config)
        watch.feed(story.heartbeat(LINK), story.heartbeat(UPF), vehicle(**FLYING_WELL))
    return watch


@settings(max_examples=300)
@given(CONFIGS, st.booleans(), st.lists(GOES, max_size=14))
def test_what_must_always_hold_does(config, flying, goes):
    run(begun(config, flying), goes)


@settings(max_examples=100)
@given(CONFIGS, st.lists(st.one_of(TOLD, OTHER, WAITS, st.just("restart")), max_size=12))
def test_on_the_ground_and_disarmed_no_rule_of_any_profile_deploys(config, goes):
    down = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    watch = Watch(config)
    for one in goes:
        if isinstance(one, i.VehicleReport):
            ages = {"armed_age": 0.0, "landed_state_age": 0.0}
            one = i.VehicleReport(dataclasses.replace(one.state, **down, **ages))
        if isinstance(one, tuple):
            one = (one[0], {**one[1], **down}, one[2])
        run(watch, [one])
        assert watch.state.stage not in (Stage.IN_FLIGHT, Stage.DEPLOYING)
        assert watch.state.deploying.deploys == ()


SILENT = st.one_of(
    WAITS,
    st.builds(
        i.LinkHeartbeat, WIRES, st.sampled_from(LinkState), st.booleans(), st.integers(0, 9)
    ),
    st.sampled_from(LinkState).map(
        lambda state: i.VehicleReport(dataclasses.replace(Story().told().state, link_state=state))
    ),
)
ONLY_SILENCE = st.one_of(
    st.builds(LinkCondition, LINKS, JUDGED, WEIGHTS),
    st.just(AutopilotCondition(AutopilotFact.LOST)),
    # True of one that falls, and no more than that: it flies well.
    st.just(MeasurementCondition("vertical_speed", below=-12.0)),
    st.just(MeasurementCondition("tilt_deg", above=60.0)),
)


@settings(max_examples=100)
@given(
    st.lists(
        st.builds(
            Rule,
            st.just("named later"),
            st.lists(ONLY_SILENCE, min_size=1, max_size=3).map(tuple),
            st.just(D),
            STATES,
            needed=st.sampled_from([1e-3, 1.0, 2.0]),
            hold=st.sampled_from([0.0, 0.5]),
        ),
        min_size=1,
        max_size=3,
    ),
    st.lists(SILENT, max_size=15),
)
def test_a_lost_heartbeat_alone_never_deploys_whatever_the_profile(rules, goes):
    config = SupervisorConfig(deploy_links=(LINK, UPF), profile=_profile(rules))
    watch = begun(config, flying=True)
    for one in goes:
        run(watch, [one])
        assert watch.state.killing.kill is None
        assert watch.state.deploying.deploys == ()


@settings(max_examples=30)
@given(
    st.lists(st.one_of(OTHER, WAITS), max_size=6),
    st.sampled_from([{"vertical_speed": -14.0}, {"tilt": 80.0}, {"acceleration": 1.0}]),
    LIES,
)
def test_one_that_falls_in_flight_is_killed_and_deployed_whatever_came_before(goes, sign, lie):
    watch = begun(shipped("multirotor", deploy_links=(LINK, UPF)), flying=True)
    run(watch, goes)
    # It flies well for a while, so that it is known to be in the air; then it falls.
    run(watch, [("told", FLYING_WELL, 20)])
    if watch.state.stage is not Stage.IN_FLIGHT:
        return
    moving = {"vertical_speed": -14.0, "acceleration": 4.5, **sign, **lie}
    # Faster and faster, as bodies do: a speed that jumped would be in doubt.
    for speed in (-5.0, -10.0):
        run(watch, [("told", {**FLYING_WELL, "vertical_speed": speed, **lie}, 1)])
    run(watch, [("told", {**FLYING_WELL, **moving}, 25)])
    assert watch.state.stage in (Stage.DEPLOYING, Stage.DEPLOYED, Stage.FAULT)
