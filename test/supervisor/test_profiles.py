"""Each rule of each shipped profile: just over its limit for just long enough it acts, just under
it, or for just too short, it does not."""

import math
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import pytest
from story import LINK, START, Story, parachute, shipped

from chute_ros.model import Action, Armed, LinkState, Outcome, ParachuteState, ParachuteStatus
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.gate import against_person
from chute_ros.supervisor.machine import Stage

K, D = Action.KILL, Action.DEPLOY
EVERY = 0.05
LOST = {"link_state": LinkState.LOST}
OFF = {"armed": Armed.DISARMED}
REBOOTED = {"reboot_count": 1, "rebooted_in_flight": True}
#: m/s between two samples.
STEP = 5
ONE_METRE = 1.0 / 111_195.0  # degrees of latitude


@dataclass(frozen=True)
class Case:
    """One rule: what is just over its limit and just under it, and for how long it must be, s."""

    profile: str
    rule: str
    over: dict[str, Any]
    under: dict[str, Any]
    hold: float
    samples: int = 3
    #: What it says before.
    before: dict[str, Any] = field(default_factory=dict)
    #: The measurement jumps; it is believed after three samples.
    jumps: bool = False
    #: It sinks faster by so much with each sample, m/s.
    speeds_up: float = 0.0

    def __str__(self) -> str:
        return f"{self.profile}, {self.rule}, {self.over}".replace("<", "").replace(">", "")

    def flying(self) -> Story:
        story = Story(shipped(self.profile)).ready()
        story.fly(0.3, every=EVERY, **self.before)
        # Faster and faster: a speed that jumped would be in doubt.
        speed = self.over.get("vertical_speed", 0.0)
        for told in range(-STEP, round(speed) + 1, -STEP):
            story.fly(story.t + EVERY, EVERY, **{**self.before, "vertical_speed": float(told)})
        return story

    def over_for(self, story: Story, samples: int) -> Story:
        told = {**self.before, **self.over}
        for _ in range(samples if self.speeds_up else 0):
            newest = min(story.state.measured("vertical_speed").value, told["vertical_speed"])
            told["vertical_speed"] = newest - self.speeds_up
            story.fly(story.t + EVERY, EVERY, **told)
        return story if self.speeds_up else story.fly(story.t + samples * EVERY, EVERY, **told)

    def enough(self) -> int:
        """So many samples in a row until it acts."""
        return max(round(self.hold / EVERY), self.samples - 1) + 1 + 2 * self.jumps


def falls(profile: str, rule: str, hold: float, less: dict[str, Any], **signs: Any) -> list[Case]:
    """Cases of a rule that needs something besides one of these signs of falling. (Heights that
    are told must not deny the sink.)"""
    without_heights = {"vertical_speed": {**less, "height": math.nan}}
    return [
        Case(
            profile,
            rule,
            {**without_heights.get(name, less), name: over},
            {**without_heights.get(name, less), name: under},
            hold,
            2,
        )
        for name, (over, under) in signs.items()
    ]


def all_needed(
    profile: str, rule: str, hold: float, besides: dict[str, Any] | None = None, **signs: Any
) -> list[Case]:
    """Cases of a rule that needs all of these signs; besides: what is told with them."""
    over = {**(besides or {}), **{name: one for name, (one, _) in signs.items()}}
    return [
        Case(profile, rule, over, {**over, name: under}, hold)
        for name, (_, under) in signs.items()
    ]


def sinks(profile: str, hold: float, sink: float, before: float = 0.1) -> list[Case]:
    """It sinks too fast, and one more sign says so; or only the one sensor."""
    over, under = {"vertical_speed": -sink - 0.1}, {"vertical_speed": -sink}
    signs = ({"acceleration": 4.9}, {"acceleration": 5.1}), ({"tilt": 45.1}, {"tilt": 44.9})
    cases, said = [], {"vertical_speed": before}
    for more, less in signs:
        cases += [
            Case(profile, "critical sink", {**over, **more}, one, hold, before=said)
            for one in ({**under, **more}, {**over, **less})
        ]
    return cases


def tips(profile: str, hold: float, tilt: float, sink: float) -> list[Case]:
    """It tips over and sinks; it tips over alone (its sensor lies), or it sinks alone."""
    both = {"tilt": tilt + 0.1, "vertical_speed": -sink - 0.1}
    unders = ({"tilt": tilt - 0.1}, {"vertical_speed": -sink + 0.1})
    return [Case(profile, "excess tilt", both, {**both, **under}, hold) for under in unders]


LEANS = {"tilt": (45.1, 44.9), "acceleration": (3.9, 4.1)}
DIVES = {"vertical_speed": (-10.1, -9.9), "tilt": (70.1, 69.9), "acceleration": (2.9, 3.1)}
BEFORE = {"battery_remaining": 0.1}


def empty(profile: str, sink: float, hold: float) -> Case:
    """It sinks beside a battery that is empty."""
    over, under = ({"battery_remaining": 0.04, "vertical_speed": -sink + by} for by in (-0.1, 0.1))
    return Case(profile, "battery dead and falling", over, under, hold, before=BEFORE)


DEPLOYS = [
    *tips("multirotor", hold=0.3, tilt=60.0, sink=3.0),
    *sinks("multirotor", hold=0.5, sink=12.0),
    *all_needed(
        "multirotor", "falling", 0.2, vertical_speed=(-7.6, -7.4), acceleration=(3.9, 4.1)
    ),
    *all_needed("multirotor", "free fall", 0.3, acceleration=(1.9, 2.1), tilt=(45.1, 44.9)),
    *falls(
        *("multirotor", "autopilot lost and falling", 0.8, LOST),
        vertical_speed=(-7.6, -7.4),
        **LEANS,
    ),
    *falls(
        *("multirotor", "autopilot rebooted in flight", 0.4, REBOOTED),
        vertical_speed=(-5.1, -4.9),
        **LEANS,
    ),
    *(
        case
        for status in (6, 8)
        for case in falls(
            *("multirotor", "autopilot terminates", 0.4, {"system_status": status}),
            vertical_speed=(-8.1, -7.9),
            **LEANS,
        )
    ),
    empty("multirotor", sink=8.0, hold=0.5),
    Case(
        *("multirotor", "battery dead and falling"),
        {"battery_remaining": 0.049, "vertical_speed": -8.1},
        {"battery_remaining": 0.051, "vertical_speed": -8.1},
        0.5,
        before=BEFORE,
    ),
    *tips("fixed_wing", hold=0.7, tilt=80.0, sink=5.0),
    *sinks("fixed_wing", hold=1.0, sink=15.0, before=-5.0),
    *all_needed(
        *("fixed_wing", "free fall", 0.5),
        acceleration=(2.9, 3.1),
        vertical_speed=(-4.1, -3.9),
        attitude_error=(45.1, 44.9),
    ),
    *all_needed(
        *("fixed_wing", "disarmed in flight", 0.4, OFF),
        vertical_speed=(-4.1, -3.9),
        acceleration=(4.9, 5.1),
    ),
    *falls("fixed_wing", "autopilot lost and falling", 1.0, LOST, **DIVES),
    *falls("fixed_wing", "autopilot rebooted in flight", 1.0, REBOOTED, **DIVES),
    *falls("fixed_wing", "autopilot terminates", 0.5, {"system_status": 8}, **DIVES),
    Case(
        *("rocket", "critical sink", {"vertical_speed": -30.1}, {"vertical_speed": -30.0}, 2.0, 5),
        speeds_up=0.25,
    ),
]
EMPTY = ({"battery_remaining": 0.049}, {"battery_remaining": 0.051})
FENCES = [("multirotor", 320.0, 120.0), ("fixed_wing", 400.0, 120.0), ("rocket", 5000.0, 12000.0)]
ALARMS = [
    *(Case(p, "autopilot lost", LOST, {}, 0.5, 1) for p in ("multirotor", "fixed_wing")),
    *(
        Case(p, "battery dead", *EMPTY, 10.0, before=BEFORE)
        for p in ("multirotor", "fixed_wing", "rocket")
    ),
    *(
        Case(
            profile,
            "geofence left",
            {"latitude": 48.0 + (radius + 1.0) * ONE_METRE},
            {"latitude": 48.0 + (radius - 1.0) * ONE_METRE},
            5.0,
            jumps=True,
        )
        for profile, radius, _ in FENCES
    ),
    *(
        Case(
            profile,
            "geofence left",
            {"height": ceiling + 0.5},
            {"height": ceiling - 0.5},
            5.0,
            before={"height": ceiling - 5.0},
        )
        for profile, _, ceiling in FENCES
    ),
]


def alarms(story: Story, rule: str) -> int:
    return sum(one.startswith(f"rule '{rule}'") for one in story.alarms())


@pytest.mark.parametrize("case", DEPLOYS, ids=str)
def test_over_its_limit_for_long_enough_it_kills_and_then_deploys(case):
    story = case.flying()
    case.over_for(story, case.enough() - 1)
    assert story.fired() == []
    case.over_for(story, 1)
    assert story.fired() == ["KILL"]
    kill = story.newest(K)
    assert kill.rule == case.rule
    assert f"counter {case.hold:.2f} s of {case.hold:g} s" in kill.reasons
    confirmed = story.fork()
    confirmed.at(story.t + 0.02, confirmed.report(K, Outcome.CONFIRMED))
    assert confirmed.fired() == ["KILL", "DEPLOY"], "at once"
    case.over_for(story, 10)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == case.rule
    assert story.when(D) == pytest.approx(story.when(K) + 0.5)


@pytest.mark.parametrize("case", DEPLOYS, ids=str)
def test_over_its_limit_for_just_too_short_or_just_under_it_for_long_it_does_nothing(case):
    story = case.flying()
    case.over_for(story, case.enough() - 2)
    story.fly(story.t + 3.0, 0.1, **case.before)
    assert story.fired() == []
    assert story.state.stage is Stage.IN_FLIGHT
    story = case.flying()
    story.fly(story.t + 3 * case.hold + 2.0, 0.1, **{**case.before, **case.under})
    assert story.fired() == []


@pytest.mark.parametrize("case", ALARMS, ids=str)
def test_over_its_limit_for_long_enough_it_warns_once_and_fires_nothing(case):
    story = case.flying()
    case.over_for(story, case.enough() - 1)
    assert alarms(story, case.rule) == 0
    case.over_for(story, 2)
    assert alarms(story, case.rule) == 1
    case.over_for(story, 100)
    assert alarms(story, case.rule) == 1
    assert story.fired() == []


@pytest.mark.parametrize("case", ALARMS, ids=str)
def test_just_under_its_limit_or_for_too_short_it_does_not_warn(case):
    story = case.flying()
    case.over_for(story, case.enough() - 2)
    told = {**case.before, **case.under}
    story.fly(story.t + EVERY, EVERY, **told)
    story.fly(story.t + 3 * case.hold + 2.0, max(EVERY, case.hold / 50), **told)
    assert alarms(story, case.rule) == 0
    assert story.fired() == []


EACH = pytest.mark.parametrize("name", ["multirotor", "fixed_wing", "rocket"])


@EACH
def test_every_rule_has_its_story(name):
    told = {case.rule for case in (*DEPLOYS, *ALARMS) if case.profile == name}
    told |= {"device asks for a kill", "parachute open", "link lost"}
    told |= {"flight computer in fault", "flight computer in fault, on its way"}
    # These have files of their own: test_field_failures.py, test_killed_aloft.py,
    # test_motors_stopped.py, test_uncommanded_sink.py, test_canopy.py, test_two_origins.py.
    told |= {"tipped over at take-off", "killed aloft and silent", "motors stopped in flight"}
    told |= {"disarmed in flight", "uncommanded sink", "sinks fast", "canopy does not carry"}
    told |= {"sinks fast under a canopy", "killed and falling", "ballistic"}
    told |= {"fall that its estimator does not tell", "off its command", "falls flat"}
    told |= {"spin that its estimator does not tell", "main overdue", "main late"}
    told |= {"sink that its estimator does not tell", "sinks on", "no canopy reported"}
    told |= {"falls fast under its drogue"}
    assert {rule.name for rule in shipped(name).profile.rules} <= told


@EACH
def test_a_flight_that_goes_well_fires_and_warns_nothing(name):
    story = Story(shipped(name)).ready()
    story.fly(2.0, height=5.0, vertical_speed=3.0)
    story.fly(20.0, height=50.0, tilt=20.0)
    story.fly(22.0, height=20.0, vertical_speed=-4.0)
    assert story.fired() == []
    assert story.alarms() == []


@pytest.mark.parametrize(
    ("height", "tilt", "fired"),
    [(2.9, 60.1, ["KILL"]), (-2.9, 60.1, ["KILL"]), (3.1, 60.1, []), (2.9, 59.9, [])],
)
def test_a_multirotor_that_tips_over_at_the_ground_stops_its_motors(height, tilt, fired):
    story = Story(shipped("multirotor")).ready().fly(1.0, height=height)
    story.fly(1.2, height=height, tilt=tilt)
    assert story.fired() == [], "not by four samples"
    story.fly(3.0, height=height, tilt=tilt)
    assert story.fired() == fired
    assert {kill.rule for kill in story.decisions(K)} <= {"tipped over at take-off"}


@pytest.mark.parametrize(("force", "fired"), [(21.6, []), (9.8, ["KILL"])])
def test_a_level_pass_at_the_height_of_the_take_off_has_not_tipped_over(force, fired):
    """At 63 degrees of bank, where no target is told: PX4 in acro, or another source."""
    story = Story(shipped("multirotor")).ready().fly(1.0, height=30.0).fly(9.0, height=2.0)
    story.fly(12.0, height=2.0, tilt=63.0, acceleration=force)
    assert story.fired() == fired


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_an_attitude_sensor_that_sends_noise_ends_no_flight(name):
    noise = Random(1)
    story = Story(shipped(name)).ready().fly(1.0)
    for step in range(1, 1200):
        story.fly(1.0 + step * EVERY, EVERY, tilt=noise.uniform(0.0, 180.0))
    assert story.fired() == []


@EACH
def test_a_device_that_asks_for_a_kill_gets_it_in_any_state(name):
    for story in (
        Story(shipped(name)),
        Story(shipped(name)).ready(),
        Story(shipped(name)).flying(),
    ):
        story.at(0.1, i.KillRequest(0, "upf_can 33", "about to launch"))
        assert story.fired() == ["KILL"]
        assert story.newest(K).rule == "device asks for a kill"
        story.at(0.2, i.KillRequest(0, "upf_can 33", "about to launch"))
        assert story.fired() == ["KILL"], "it is on its way"


@EACH
def test_an_open_parachute_stops_the_motors_in_flight_and_fires_nothing_on_the_ground(name):
    story = Story(shipped(name)).ready()
    story.at(0.1, story.heartbeat(), parachute(deployed=True))
    assert story.fired() == []
    story = Story(shipped(name)).ready().fly(1.0)
    story.at(1.1, story.heartbeat(), parachute(deployed=True))
    assert story.newest(K).rule == "parachute open"
    assert story.state.stage is Stage.DEPLOYED
    story.fall(5.0)
    assert story.fired() == ["KILL"], "it is not deployed again"


def abnormal(story: Story, device: str = "1/161") -> None:
    broken = ParachuteStatus(device, LinkState.OK, ParachuteState.ABNORMAL, faults=("IMU",))
    story.at(story.t, i.ParachuteReport(LINK, broken))


@EACH
def test_a_flight_computer_in_fault_is_an_alarm(name):
    story = Story(shipped(name)).ready().fly(1.0)
    abnormal(story)
    assert sum("flight computer in fault" in one for one in story.alarms()) == 1
    story.fly(10.0)
    assert story.fired() == []


@pytest.mark.parametrize(("climbs", "fires"), [(60.0, False), (12.0, False), (8.0, True)])
def test_a_rocket_that_climbs_is_not_ended_by_its_speed_alone(climbs, fires):
    """Given a speed that is suddenly 33 m/s down, which at ten samples a second is no jump."""
    story = Story(shipped("rocket")).ready()
    for step in range(80):
        told = {"height": 300.0 + climbs * step * 0.1, "acceleration": 0.5}
        speed = climbs if step < 20 else -33.0 - step * 0.5
        story.fly(story.t + 0.1, every=0.1, vertical_speed=speed, **told)
    assert bool(story.fired()) is fires


@pytest.mark.parametrize("height", [3000.0, math.nan])
def test_a_rocket_that_falls_is_deployed_beside_heights_that_tell_nothing(height):
    story = Story(shipped("rocket")).ready().fly(1.0, height=3000.0, vertical_speed=1.0)
    story.sink(story.t + 8.0, 60.0, height=height, acceleration=3.0)
    assert story.fired() == ["KILL", "DEPLOY"]


@pytest.mark.parametrize(("sinks", "fires"), [(38.0, False), (59.0, False), (70.0, True)])
def test_a_rocket_that_falls_as_fast_as_it_can_is_told_from_one_under_its_drogue(sinks, fires):
    """Given a sink that does not grow, as of recorded rockets under a drogue at 8 km and near the
    ground, and of one that came down without any: it was known before only as it sped up."""
    story = Story(shipped("rocket")).ready().fly(1.0, height=3000.0, vertical_speed=1.0)
    story.fly(4.0, height=math.nan, vertical_speed=math.nan)
    for step in range(40):
        height = 2800.0 - sinks * step * 0.1
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=-sinks)
    assert bool(story.fired()) is fires
    if fires:
        assert story.newest(D).rule == "ballistic"


@pytest.mark.parametrize("fix", [True, False])
@pytest.mark.parametrize("swing", [0.0, 3.0, 4.0])
@pytest.mark.parametrize("sinks", [31.0, 36.0, 40.0])
def test_under_a_drogue_that_swings_nothing_else_is_ordered(sinks, swing, fix):
    """Given speeds under working drogues, with a receiver and by the heights of a barometer alone;
    a swing of 3 m/s takes 4 s, one of 4 m/s 10 s."""
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=3700.0), 3700.0
    period = 4.0 if swing == 3.0 else 10.0
    for step in range(300):
        t = step * 0.1
        swings = swing * min(t / 8.0, 1.0) * math.sin(2.0 * math.pi * t / period)
        speed = -sinks * math.tanh(9.81 * t / sinks) + swings
        height += 0.1 * speed
        told = {"vertical_speed": speed if fix else math.nan}
        story.fly(story.t + 0.1, every=0.1, height=height, **told)
    assert story.fired() == []


def under_drogue() -> i.ParachuteReport:
    """The main is the parachute, and the drogue before it is out."""
    report = parachute()
    return replace(report, status=replace(report.status, state=ParachuteState.LAUNCHED))


@pytest.mark.parametrize(("fastest", "fires"), [(58.0, False), (75.0, True)])
def test_a_drogue_that_is_known_to_be_out_may_be_as_fast_as_one_is(fastest, fires):
    """Given the main as the parachute, and a drogue high up, under which it speeds up as in a fall
    for as long."""
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=8000.0), 8000.0
    story.at(story.t + 0.01, under_drogue())
    for step in range(200):
        speed = -min(9.81 * step * 0.1, fastest)
        height += 0.1 * speed
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed)
    assert bool(story.fired()) is fires
    if fires:
        assert story.newest(D).rule == "ballistic"


def test_a_rocket_that_falls_on_under_a_canopy_is_an_alarm_that_does_not_stop():
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=3700.0), 3700.0
    story.at(story.t + 0.01, parachute(deployed=True))
    for step in range(200):
        speed = -min(9.81 * step * 0.1, 100.0)
        height += 0.1 * speed
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed)
    assert any("the canopy does not carry, and no other is left" in one for one in story.alarms())


def falls_on(story: Story, height: float, until: float, fastest: float) -> float:
    """It speeds up to this, m/s, for so long, s; where it is then."""
    begun = story.t
    while story.t < begun + until:
        speed = -min(30.0 + 9.81 * (story.t - begun), fastest)
        height += 0.1 * speed
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed)
    return height


@pytest.mark.parametrize("flagged", [True, False])
def test_a_drogue_of_ours_that_does_not_carry_is_followed_by_the_main(flagged):
    """Given `deploy_stage` next, and a charge that is a dud; not every firmware sets a flag."""
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=3700.0), 3700.0
    height = falls_on(story, height, 3.0, 73.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    if flagged:
        story.at(story.t + 0.01, under_drogue(), story.report(Action.DEPLOY, Outcome.CONFIRMED))
        assert story.state.stage is Stage.DEPLOYED
        assert against_person(story.config, story.state, True, START + story.t) == ""
    else:
        story.at(story.t + 0.01, story.report(Action.DEPLOY, Outcome.SENT))
        falls_on(story, height, story.config.deploy_timeout, 73.0)
    falls_on(story, height, 8.0, 73.0)
    assert "canopy does not carry" in {one.rule for one in story.decisions(D)}


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
@pytest.mark.parametrize(("sinks", "again"), [(30.0, True), (6.0, False)])
def test_an_order_that_nobody_confirms_is_given_again_while_it_falls_on(profile, sinks, again):
    """Given a deploy that was sent, and nothing more: its board hung, or its canopy carries."""
    story, height, speed = Story(shipped(profile)).ready().fly(1.0, height=900.0), 900.0, 0.0

    def goes_on(seconds, towards):
        nonlocal height, speed
        for _ in range(round(seconds / 0.1)):
            speed += min(max(towards - speed, -1.0), 1.0)
            height += 0.1 * speed
            story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed)

    goes_on(4.0, -30.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    story.at(story.t + 0.01, story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(story.t + 0.01, story.report(Action.DEPLOY, Outcome.SENT))
    goes_on(story.config.deploy_timeout, -sinks)
    assert story.state.stage is Stage.FAULT
    goes_on(4.0, -sinks)
    assert ("canopy does not carry" in {one.rule for one in story.decisions(D)}) is again


@pytest.mark.parametrize("anew", [{}, {**REBOOTED, "height_holds": True}])
@pytest.mark.parametrize(("sinks", "fires"), [(22.0, True), (12.5, True), (8.0, False)])
def test_a_main_that_is_overdue_is_ordered(sinks, fires, anew):
    """Given a drogue that is out, and a main that is the parachute and never comes: a flight
    computer that started anew knows nothing of it."""
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=600.0), 600.0
    story.at(story.t + 0.01, under_drogue())
    while height > 30.0:
        height -= 0.1 * sinks
        told = {"height": height, "vertical_speed": -sinks, **anew}
        story.fly(story.t + 0.1, every=0.1, **told)
        if "DEPLOY" in story.fired():
            break
    assert ("DEPLOY" in story.fired()) is fires
    if fires:
        assert story.newest(D).rule == "main overdue"
        assert 90.0 < height < 150.0 - sinks


@pytest.mark.parametrize("sinks", [16.0, 30.0, 45.0])
def test_a_rocket_that_tumbles_down_without_a_word_of_a_canopy_is_told_and_ordered(sinks):
    """As slowly as under a fast drogue; nothing ever says LAUNCHED."""
    story, height, speed = Story(shipped("rocket")).ready().fly(1.0, height=1500.0), 1500.0, 0.0
    while height > 20.0:
        speed = max(speed - 0.98 * (1.0 - (speed / sinks) ** 2), -sinks)
        height += 0.1 * speed
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed)
        if story.fired():
            break
    assert story.newest(K).rule == "main overdue"
    assert 70.0 < height < 150.0 - sinks
    assert any("nothing reports a canopy" in one for one in story.alarms()) is (sinks > 20.0)


def test_under_a_drogue_that_is_the_parachute_a_main_that_is_late_is_told():
    story, height = Story(shipped("rocket")).ready().fly(1.0, height=300.0), 300.0
    story.at(story.t + 0.01, parachute(deployed=True))
    while height > 50.0:
        height -= 2.2
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=-22.0)
    assert any("fire the main by hand" in one for one in story.alarms())
    assert "DEPLOY" not in story.fired()


def test_a_rocket_in_fault_that_comes_down_is_deployed():
    story = Story(shipped("rocket")).ready().fly(1.0)
    abnormal(story)
    story.fly(4.0, vertical_speed=-19.9)
    assert story.fired() == []
    story.fly(6.0, vertical_speed=-20.1)
    assert story.fired() == []
    story.fly(6.6, vertical_speed=-20.1)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "flight computer in fault"


def test_under_a_drogue_a_fault_orders_no_main():
    """Real drogues came down with 30 to 38 m/s."""
    story = Story(shipped("rocket")).ready().fly(1.0)
    story.at(story.t + 0.01, under_drogue())
    abnormal(story, "2")
    story.fly(8.0, height=1500.0, vertical_speed=-36.0)
    assert story.fired() == []


@pytest.mark.parametrize("drogue", [False, True])
@pytest.mark.parametrize("ground", [0.0, -280.0])
def test_a_rocket_whose_computer_started_anew_without_a_fix_is_seen_to_fall(ground, drogue):
    """By its heights alone, whatever they are above since then. One that sinks as fast all the
    time is under a drogue."""
    story = Story(shipped("rocket")).ready().fly(1.0, height=900.0, vertical_speed=1.0)
    unfixed = {**REBOOTED, "vertical_speed": math.nan}
    story.fly(1.05, height=900.0 + ground, **unfixed)
    assert [height for _, height in story.state.heard.heights] in ([], [900.0 + ground])
    for step in range(1, 200):
        way = 40.0 * step * 0.05 if drogue else 9.81 * (step * 0.05) ** 2 / 2.0
        story.fly(story.t + 0.05, height=900.0 + ground - way, **unfixed)
        if story.fired():
            break
    if drogue:
        assert story.fired() == []
        return
    assert story.fired() == ["KILL"]
    assert story.newest(K).rule == "critical sink"
    # The rate of the last second's heights is half a second late.
    assert story.t == pytest.approx(1.05 + 30.0 / 9.81 + 0.5 + 2.0, abs=0.3)


def test_a_rocket_whose_computer_starts_anew_with_another_height_does_not_fall():
    story = Story(shipped("rocket")).ready().fly(1.0, height=300.0, vertical_speed=1.0)
    unfixed = {**REBOOTED, "vertical_speed": math.nan}
    for height in (300.0, 250.0, 0.0):
        story.fly(story.t + 4.0, height=height, **unfixed)
    assert story.fired() == []


def test_a_rocket_coasts_in_free_fall_and_turns_over_without_a_deploy():
    story = Story(shipped("rocket")).ready().fly(1.0, acceleration=90.0, vertical_speed=80.0)
    story.fly(9.0, acceleration=0.3, vertical_speed=10.0, tilt=175.0)
    story.fly(15.0, acceleration=9.0, vertical_speed=-15.0, tilt=175.0)
    assert story.fired() == []


@EACH
def test_a_lost_link_in_flight_is_an_alarm_and_no_more(name):
    story = Story(shipped(name)).ready().fly(1.0)
    for n in range(1, 200):
        story.at(1.0 + n * 0.05, story.told())
    assert alarms(story, "link lost") == 1
    assert story.fired() == []


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_an_autopilot_that_falls_silent_with_everything_else_is_an_alarm_in_its_time(name):
    story = Story(shipped(name)).ready().fly(1.0)
    story.at(3.9)
    assert alarms(story, "autopilot lost") == 0
    story.at(4.1)
    assert alarms(story, "autopilot lost") == 1
    story.at(60.0)
    assert story.fired() == []


#: A wing that dives on purpose, and what its command is.
DIVE = {"vertical_speed": -11.0, "tilt": 25.0, "attitude_error": 4.0, "acceleration": 9.0}


@pytest.mark.parametrize("before", [{"battery_remaining": 0.0}, REBOOTED])
def test_a_dive_that_is_commanded_is_no_fall_beside_an_empty_battery_or_a_restart(before):
    story = Story(shipped("fixed_wing")).ready().fly(2.0, height=120.0)
    story.fly(3.0, height=120.0, **before)
    height = 120.0
    for _ in range(60):
        height -= 0.55
        story.fly(story.t + 0.05, height=height, **DIVE, **before)
    assert story.fired() == []


@pytest.mark.parametrize(("steady", "fires"), [(5.0, True), (30.0, False)])
@pytest.mark.parametrize(
    ("profile", "does"),
    [
        ("multirotor", {"vertical_speed": -5.3}),
        ("fixed_wing", {"tilt": 74.0, "acceleration": 35.0}),
    ],
)
def test_a_restart_after_which_it_flew_on_ends_no_manoeuvre_of_later(profile, does, steady, fires):
    """ArduPlane arms itself again after its watchdog, and flies on."""
    story = Story(shipped(profile)).ready().fly(2.0, height=120.0)
    story.fly(2.0 + steady, height=120.0, **REBOOTED)
    story.fly(story.t + 2.0, **{"height": 118.0, **does, **REBOOTED})
    assert bool(story.fired()) is fires
    # What falls by the next restart falls by that.
    again = {"reboot_count": 2, "rebooted_in_flight": True}
    story.fly(story.t + 1.0, height=110.0, **again)
    story.fly(story.t + 2.0, height=110.0, **{**does, **again})
    assert story.fired()


@pytest.mark.parametrize(("slows", "fires"), [(1.5, False), (0.0, True)])
def test_a_descent_that_is_caught_with_full_thrust_is_no_sink_that_goes_on(slows, fires):
    """Full thrust upright counts as a command not to sink."""
    story = Story(shipped("multirotor")).ready().fly(2.0, height=150.0)
    speed, height = 0.0, 150.0
    for k in range(90):
        descends = k < 50
        change = -0.2 if descends else 0.1 * slows
        height, speed = height + 0.1 * speed, min(max(speed + change, -9.0), -1.0)
        told = {"target_vertical_speed": -9.0 if descends else 0.0, "acceleration": 9.8 + slows}
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=speed, **told)
    assert bool(story.fired()) is fires


def test_sticks_that_are_reversed_in_a_descent_end_no_flight_of_an_aeroplane():
    """From one bank to the other, 120 degrees away, within 0.3 s; it rolls with 150 degrees a
    second, 0.1 s later, and is pushed over meanwhile."""
    story, force, speed = Story(shipped("fixed_wing")).ready(), 9.8, -5.0
    story.fly(2.0, EVERY, vertical_speed=speed, height=100.0, attitude_error=0.0, tilt=60.0)
    begun, far = story.t, 0
    while (passed := story.t + 0.05 - begun) < 0.9:
        rolled = max(0.0, 150.0 * (passed - 0.1))
        error = min(120.0, 400.0 * passed) - rolled
        far += error > 45.0
        force, speed = max(1.5, force - 2.6), speed - 0.05 * (9.8 - force)
        told = {"acceleration": force, "vertical_speed": speed, "attitude_error": error}
        story.fly(story.t + 0.05, 0.05, height=100.0 + speed, tilt=abs(60.0 - rolled), **told)
    story.fly(story.t + 1.0, 0.05, vertical_speed=speed, attitude_error=0.0, tilt=60.0)
    assert far == 10, "for 0.5 s, and without force for most of it"
    assert story.fired() == []


@pytest.mark.parametrize(
    ("rule", "told", "for_s"),
    [
        ("sinks fast", {"vertical_speed": -7.2}, 1.0),
        ("battery dead", {"battery_remaining": 0.02}, 11.0),
    ],
)
def test_by_hand_who_alone_decides_is_warned(rule, told, for_s):
    story = Story(shipped("by_hand")).ready().fly(2.0)
    story.fly(2.0 + for_s, **told)
    assert alarms(story, rule) == 1
    assert story.fired() == []


def test_by_hand_a_silent_autopilot_is_told():
    story = Story(shipped("by_hand")).ready().fly(1.0)
    story.at(4.1)
    assert alarms(story, "autopilot lost") == 1


#: Vertical speed, force and tilt of an aeroplane of 30 m/s that is pushed over to 18 degrees.
PUSHED_OVER = (
    *((-0.2, 6.8, 0), (-0.6, 4.7, 2), (-1.2, 3.1, 4), (-1.9, 2.0, 6), (-2.8, 1.2, 8)),
    *((-3.6, 0.9, 10), (-4.5, 1.2, 11), (-5.3, 1.8, 13), (-6.0, 2.5, 14), (-6.7, 3.3, 14)),
    *((-7.3, 4.0, 15), (-7.7, 4.8, 16), (-8.2, 5.4, 16), (-8.5, 6.0, 16), (-8.8, 6.5, 17)),
    *((-9.1, 6.9, 17), (-9.3, 7.6, 18), (-9.3, 8.3, 18), (-9.3, 8.8, 18), (-9.3, 8.9, 18)),
)


@pytest.mark.parametrize(("commanded", "fires"), [(18.0, []), (0.0, ["KILL"])])
def test_a_fast_wing_that_is_pushed_over_as_commanded_does_not_fall_flat(commanded, fires):
    story, height = Story(shipped("fixed_wing")).ready().fly(2.0, height=120.0), 120.0
    for speed, force, tilt in PUSHED_OVER:
        height += 0.1 * speed
        told = {"vertical_speed": speed, "acceleration": force, "tilt": float(tilt)}
        error = max(2.0, tilt - commanded)
        story.fly(story.t + 0.1, 0.1, height=height, attitude_error=error, **told)
    assert story.fired() == fires
