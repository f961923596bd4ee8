"""Every sequence of a small alphabet of inputs: what must hold holds after each."""

from collections.abc import Callable, Iterator

import pytest
from invariants import Watch, reports_of
from story import LINK, SINKS, Story, falling, parachute, rule, vehicle, with_rules

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import DEVICE_RULES, BelowMinimum
from chute_ros.supervisor.yaml_lines import ANY

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
GROUND, AIR = LandedState.ON_GROUND, LandedState.IN_AIR
#: One rule that falls, two that mistake silence for a fall; alive wherever they are let.
RULES = (
    *DEVICE_RULES,
    rule(SINKS, states=tuple(Stage), name="sinks"),
    rule(LinkCondition(ANY, (LinkJudgement.LOST,)), states=tuple(Stage), name="link"),
    rule(AutopilotCondition(AutopilotFact.LOST), states=tuple(Stage), name="autopilot"),
)
CONFIG: SupervisorConfig = with_rules(
    *RULES,
    profile={"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL, "landed_hold": 0.1},
    deploy_links=(LINK, UPF),
    deploy_ladder=(Rung(LINK), Rung(UPF, "trigger")),
    ladder_step_timeout=1.0,
    resend_interval=2.0,
    deploy_timeout=2.0,
    alarm_interval=30.0,
)
Letter = Callable[[Watch], None]


def tell(**told: object) -> Letter:
    """0.3 s later the vehicle says this, and its node lives."""
    report = vehicle(**told)

    def letter(watch: Watch) -> None:
        watch.wait(0.3)
        seq = watch.state.evidence(LINK).seq + 1
        watch.feed(i.LinkHeartbeat(LINK, LinkState.OK, True, seq), report)

    return letter


def reported(action: Action, outcome: Outcome, link: str = LINK) -> Letter:
    return lambda watch: watch.feed(*reports_of(watch, action, outcome, link)) and None


def given(*inputs: i.Input) -> Letter:
    return lambda watch: watch.feed(*inputs) and None


WELL = {"armed": Armed.ARMED, "landed_state": AIR, "vertical_speed": 0.0, "height": 50.0}
FALLS = {**WELL, "vertical_speed": -14.0, "acceleration": 6.5}
LETTERS: dict[str, Letter] = {
    "stands": tell(armed=Armed.DISARMED, landed_state=GROUND, vertical_speed=0.0, height=0.0),
    "flies": tell(**WELL),
    "falls": tell(**FALLS),
    "falls low": tell(**{**FALLS, "height": 9.0}),
    "falls and says landed": tell(**{**FALLS, "armed": Armed.DISARMED, "landed_state": GROUND}),
    "silence": lambda watch: watch.wait(3.0),
    "kill confirmed": reported(K, Outcome.CONFIRMED),
    "deploy failed": reported(D, Outcome.FAILED),
    "deploy confirmed": reported(D, Outcome.CONFIRMED),
    "person": given(i.DeployRequest(5, False, "it falls")),
}
MORE: dict[str, Letter] = {
    **LETTERS,
    "forced": given(i.DeployRequest(5, True, "a test")),
    "killed": given(i.KillRequest(6, "operator", "stop")),
    "asked": given(i.KillRequest(0, "upf_can 33", "about to launch")),
    "is out": given(parachute(deployed=True)),
    "is packed": given(parachute(deployed=False)),
    "node restarts": given(i.LinkHeartbeat(LINK, LinkState.OK, True, 0)),
    "trigger failed": reported(D, Outcome.FAILED, UPF),
    "reset": given(i.ResetRequest(7)),
    "restarts": lambda watch: watch.restart(),
    "shadow": given(i.ModeRequest(8, i.Mode.SHADOW, True)),
    "active": given(i.ModeRequest(8, i.Mode.ACTIVE, True)),
}


def beginnings() -> Iterator[tuple[str, Watch]]:
    yield "start", Watch(CONFIG)
    for name in ("stands", "flies"):
        watch = Watch(CONFIG)
        LETTERS["stands"](watch)
        LETTERS[name](watch)
        yield name, watch


def every_sequence(watch: Watch, letters: dict[str, Letter], depth: int, told: str = "") -> int:
    """All of them, each beginning shared; how many updates were watched."""
    if depth == 0:
        return 0
    count = 0
    for name, letter in letters.items():
        branch = watch.copy()
        told_now = f"{told}, {name}"
        try:
            letter(branch)
        except AssertionError as error:
            raise AssertionError(f"{error} after{told_now}") from error
        count += 1 + every_sequence(branch, letters, depth - 1, told_now)
    return count


@pytest.mark.parametrize(
    ("number", "depth"), [(0, 3), (1, 3), (2, 3), pytest.param(2, 4, marks=pytest.mark.long)]
)
def test_every_sequence_of_ten_inputs(number, depth):
    name, watch = list(beginnings())[number]
    assert every_sequence(watch, LETTERS, depth, name) == sum(10**n for n in range(1, depth + 1))


@pytest.mark.parametrize("number", range(3))
def test_every_sequence_of_all_inputs_to_a_depth_of_two(number):
    name, watch = list(beginnings())[number]
    depth = 2
    assert every_sequence(watch, MORE, depth, name) == sum(21**n for n in range(1, depth + 1))


@pytest.mark.parametrize("depth", [4, pytest.param(5, marks=pytest.mark.long)])
def test_every_sequence_of_the_ladder(depth):
    names = ("kill confirmed", "deploy failed", "trigger failed", "deploy confirmed", "silence")
    watch = Watch(CONFIG)
    for letter in ("stands", "flies", "person"):
        LETTERS[letter](watch)
    letters = {name: MORE[name] for name in names}
    assert every_sequence(watch, letters, depth, "person") == sum(
        5**n for n in range(1, depth + 1)
    )


@pytest.mark.parametrize("before", ["stands", "flies", "silence"])
def test_on_the_ground_no_sequence_without_a_person_fires_anything(before):
    down = {"armed": Armed.DISARMED, "landed_state": GROUND}
    on_ground = {
        "stands": LETTERS["stands"],
        "drifts": tell(**down, vertical_speed=-14.0, height=-50.0),
        "tumbles": tell(**down, tilt=120.0, acceleration=0.1),
        "silence": LETTERS["silence"],
        "restarts": MORE["restarts"],
    }
    watch = Watch(CONFIG)

    def nothing(branch: Watch) -> Watch:
        for output in branch.outputs:
            if isinstance(output, i.Decide):
                assert output.decision.action < K
        return branch

    def checked(letter: Letter) -> Letter:
        def both(branch: Watch) -> None:
            letter(branch)
            nothing(branch)

        return both

    letters = {name: checked(letter) for name, letter in on_ground.items()}
    if before in on_ground:
        letters[before](watch)
    assert every_sequence(watch, letters, 4, before) == 780


def test_whatever_came_before_one_that_falls_in_flight_is_killed_at_once():
    """Every two letters before; then it falls in earnest."""
    *_, (_, flies) = beginnings()
    for first in MORE.values():
        begun = flies.copy()
        first(begun)
        for second in MORE.values():
            watch = begun.copy()
            second(watch)
            if watch.state.stage is not Stage.IN_FLIGHT or watch.state.mode is not i.Mode.ACTIVE:
                continue
            LETTERS["falls"](watch)
            if watch.state.measured("vertical_speed").rejected:
                LETTERS["falls"](watch)
            decided = [o.decision.action for o in watch.outputs if isinstance(o, i.Decide)]
            assert K in decided
            watch.wait(CONFIG.kill_to_deploy_delay + 0.01)
            assert watch.state.stage in (Stage.DEPLOYING, Stage.DEPLOYED)


def test_a_fall_of_any_length_in_any_phase_of_the_update_is_one_kill_and_one_deploy():
    for every in (0.01, 0.05, 0.1, 0.2):
        for silent_after in (5, 12, 40):
            story = Story(CONFIG).flying()
            for n in range(1, silent_after + 1):
                story.at(n * every, story.heartbeat(), story.told(**falling(n * every + 2.0)))
            story.at(story.t + 3.0)
            assert story.fired()[:2] == ["KILL", "DEPLOY"]
