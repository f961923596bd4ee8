"""Every word of what is said of a profile, and every limit in it."""

import pytest
from test_profile_reader import WHOLE, mistakes, read

from chute_ros.errors import ProfileError
from chute_ros.model import Action
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import STANDARD_LIMITS
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.rules import BelowMinimum, Clears, Rule

FALLS = Rule(
    "falls",
    (
        MeasurementCondition("vertical_speed", below=-12.5, weight=2.0),
        MeasurementCondition("tilt_deg", above=60.0, below=170.0),
        LinkCondition("any", (LinkJudgement.STALE, LinkJudgement.LOST)),
        AutopilotCondition(AutopilotFact.REBOOTED),
        DeviceCondition(DeviceFact.ABNORMAL, "upf_can", 0.5),
    ),
    Action.DEPLOY,
    (Stage.IN_FLIGHT, Stage.KILLING),
    needed=3.0,
    hold=0.5,
    leak=0.25,
    samples=3,
    clears=Clears.ON_DISARM,
    says="it falls, fast",
    source="ours",
)

ONE_RULE = "profile: p\nrules: {a: {states: READY, conditions: {autopilot: lost}, action: ALARM}}"


def spoilt(old: str, new: str) -> list[str]:
    """What is said with this instead of that, without the name of the file."""
    assert WHOLE.count(old) >= 1
    told = mistakes(WHOLE.replace(old, new, 1))
    assert all(one.startswith("mine.yaml, ") for one in told)
    return [one.removeprefix("mine.yaml, ") for one in told]


def rule(**lines: str) -> Rule:
    """The one rule of a profile that differs from a simple one in these lines."""
    given = {"states": "IN_FLIGHT", "conditions": "{autopilot: rebooted}", "action": "KILL"}
    told = "".join(f"    {key}: {value}\n" for key, value in {**given, **lines}.items())
    (only,) = read(f"profile: p\nrules:\n  a:\n{told}").rules
    return only


def test_each_part_of_a_rule_is_read_as_it_is_written() -> None:
    # A limit that is not asked for is NaN, which is not equal to itself; its text is.
    assert repr(read(WHOLE).rules[0]) == repr(FALLS)


def test_a_link_may_be_all_and_a_device_on_any() -> None:
    assert rule(conditions="{link: all, is: LOST, weight: 2}").conditions == (
        LinkCondition("all", (LinkJudgement.LOST,), 2.0),
    )
    assert rule(conditions="{autopilot: lost, weight: 3}").conditions == (
        AutopilotCondition(AutopilotFact.LOST, 3.0),
    )
    for text in ("{device: deployed}", "{device: deployed, link: any}"):
        assert rule(conditions=text).conditions == (DeviceCondition(DeviceFact.DEPLOYED),)


def test_every_word_for_an_action_is_what_it_says() -> None:
    words = {"ALARM": Action.NONE, "FLIGHT_BLOCK": Action.FLIGHT_BLOCK}
    for word, action in {**words, "KILL": Action.KILL, "DEPLOY": Action.DEPLOY}.items():
        assert rule(action=word).action is action


def test_every_word_for_what_happens_below_the_minimum_is_what_it_says() -> None:
    for one in BelowMinimum:
        assert read(WHOLE.replace("nothing", one.value)).below_minimum is one


@pytest.mark.parametrize(
    ("key", "least", "most", "less", "more"),
    [
        ("minimum_height", 0.0, 1000.0, "-0.5", "1000.5"),
        ("low_height", 0.0, 1000.0, "-0.5", "1000.5"),
        ("landed_hold", 0.0, 60.0, "-0.5", "60.5"),
        ("moving_speed", 0.1, 20.0, "0.05", "20.5"),
    ],
)
def test_a_number_of_the_profile_may_reach_its_limits(
    key: str, least: float, most: float, less: str, more: str
) -> None:
    text = f"{ONE_RULE}\n"
    for good in (least, most):
        assert getattr(read(f"{text}{key}: {good}"), key) == good
    for wrong in (less, more):
        said = f"mine.yaml, line 3: {key} is {wrong}: need {least:g} to {most:g}"
        assert mistakes(f"{text}{key}: {wrong}") == [said]


@pytest.mark.parametrize(
    ("key", "field", "least", "most", "less", "more"),
    [
        ("for", "hold", 0.0, 60.0, "-0.5", "60.5"),
        ("leak", "leak", 0.01, 100.0, "0.005", "100.5"),
        ("needed", "needed", 1e-6, 1e6, "0.0000005", "1000000.5"),
    ],
)
def test_a_number_of_a_rule_may_reach_its_limits(
    key: str, field: str, least: float, most: float, less: str, more: str
) -> None:
    conditions = "{autopilot: rebooted, weight: 1000000}"
    for good in (least, most):
        assert getattr(rule(conditions=conditions, **{key: f"{good:.6f}"}), field) == good
    for wrong in (less, more):
        with pytest.raises(ProfileError) as caught:
            rule(conditions=conditions, **{key: wrong})
        said = f"{key} of rule 'a' is {float(wrong)}: need {least:g} to {most:g}"
        assert f"mine.yaml, line 7: {said}" in str(caught.value).splitlines()


def test_samples_are_counted_in_whole_numbers_up_to_fifty() -> None:
    for good in (1, 2, 50):
        samples = rule(samples=str(good), **{"for": "0.1"}).samples
        assert (samples, type(samples)) == (good, int)
    for wrong, need in (("51", "1 to 50"), ("0", "1 to 50"), ("1.5", "a whole number")):
        with pytest.raises(ProfileError) as caught:
            rule(samples=wrong)
        said = f"mine.yaml, line 7: samples of rule 'a' is {wrong}: need {need}"
        assert str(caught.value) == said


def test_more_than_one_sample_needs_a_time_in_which_they_come() -> None:
    with pytest.raises(ProfileError, match="rule 'a' needs 2 samples at once"):
        rule(samples="2")
    said = "rule 'falls' needs 3 samples at once: add `for`, in which they may come"
    assert spoilt("    for: 0.5\n", "") == [f"line 22: {said}"]
    assert spoilt("for: 0.5", "for: 0") == [f"line 23: {said}"]
    assert rule(samples="1").samples == 1


def test_a_weight_may_reach_its_limits() -> None:
    for good in ("0.000001", "1000000"):
        condition = f"{{autopilot: rebooted, weight: {good}}}"
        assert rule(conditions=condition).needed == float(good)
    for wrong in ("0.0000005", "1000000.5"):
        with pytest.raises(ProfileError) as caught:
            rule(conditions=f"{{autopilot: rebooted, weight: {wrong}}}")
        said = f"mine.yaml, line 5: weight in rule 'a' is {float(wrong)}: need 1e-06 to 1e+06"
        assert str(caught.value) == said


def test_as_much_as_all_conditions_weigh_may_be_needed_and_no_more() -> None:
    assert read(WHOLE.replace("needed: 3", "needed: 5.5")).rules[0].needed == 5.5
    said = "the weights of its conditions add up to only 5.5"
    assert rule(needed="1.000000001").needed == 1.000000001, "that is rounding"
    (told,) = spoilt("needed: 3", "needed: 5.6")
    assert told == f"line 20: needed of rule 'falls' is 5.6: {said}"


def test_silence_may_add_to_a_deploy_but_never_be_all_of_it() -> None:
    assert read(WHOLE.replace("needed: 3", "needed: 1.1")).rules[0].needed == 1.1
    lost = WHOLE.replace("autopilot: rebooted", "autopilot: lost")
    said = "rule 'falls' would deploy on silence alone, which is never done"
    assert mistakes(lost.replace("needed: 3", "needed: 1.9")) == [
        f"mine.yaml, line 9: {said}: raise needed above 2, or add a measurement"
    ]
    with pytest.raises(ProfileError, match=r"above 1, or add a measurement"):
        rule(conditions="{link: any, is: LOST}", needed="1.000000001", action="DEPLOY")
    assert rule(conditions="{link: any, is: LOST}").action is Action.KILL, "motors may stop so"


def test_a_mistake_in_the_rules_is_told_after_one_in_the_measurements() -> None:
    text = WHOLE.replace("jump: 20.0", "jump: -1").replace("action: ALARM", "action: ALERT")
    need = "need ALARM or FLIGHT_BLOCK or KILL or DEPLOY (did you mean ALARM?)"
    assert mistakes(text) == [
        "mine.yaml, line 7: jump of height is -1: need 0 to 200",
        f"mine.yaml, line 29: action of rule 'silent' is 'ALERT': {need}",
    ]


def test_a_limit_that_is_no_number_says_of_what() -> None:
    assert "line 7: jump of height is 'x': need a number" in spoilt("jump: 20.0", "jump: x")


@pytest.mark.parametrize("name", STANDARD_LIMITS)
def test_every_measurement_may_have_limits_of_its_own(name: str) -> None:
    limits = read(f"{ONE_RULE}\nmeasurements: {{{name}: {{max_age: 3}}}}").limits
    assert limits[name].max_age == 3.0
    assert {**limits, name: None} == {**STANDARD_LIMITS, name: None}


def test_what_is_no_profile_names_its_file_and_what_is_no_rules_says_so() -> None:
    assert mistakes("profile: [p\n---\n")[0].startswith("mine.yaml, line 2: not YAML: ")
    need = "need `key: value` lines"
    assert mistakes("profile: p\nrules: 3\n") == [f"mine.yaml, line 2: rules is 3: {need}"]


def test_without_any_link_only_any_can_be_named() -> None:
    text = WHOLE.replace("link: upf_can", "link: x")
    with pytest.raises(ProfileError) as caught:
        read_profile(text, "mine.yaml", ())
    assert "mine.yaml, line 19: link in rule 'falls' is 'x': need any" in str(caught.value)


def test_what_a_mistake_stands_for_meanwhile_is_no_second_mistake() -> None:
    """A word that is not known is no silence; the deploy is looked at once it is put right."""
    text = (
        "profile: p\nrules:\n  a:\n    states: KILLING\n    action: DEPLOY\n"
        "    conditions: {autopilot: killed_aloof}\n"
    )
    (only,) = mistakes(text)
    assert "(did you mean killed_aloft?)" in only


FACTS = "lost or rebooted or disarmed or emergency or killed_aloft or motors_stopped"
MEASUREMENTS = (*STANDARD_LIMITS, "climb_rate", "vertical_acceleration")
JUDGEMENTS = "NEVER_SEEN, OK, STALE, LOST, REGAINED, UNMONITORED"
PROFILE_KEYS = (
    "profile, minimum_height, below_minimum, low_height, moving_speed, landed_hold, "
    "measurements, rules"
)
RULE_KEYS = "says, source, states, conditions, needed, for, leak, samples, doubted, action, clears"
CONDITION_KEYS = (
    "measurement, link, autopilot, device, above, below, until, if_unknown, unless_dived, is, "
    "counted, weight"
)
LIMIT_KEYS = "minimum, maximum, rate, jump, max_age, stuck_after"
FLYING = "its states may be IN_FLIGHT, KILLING and DEPLOYED"
KINDS = "needs one of measurement, link, autopilot, device; it has"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("profile: mine\n", "", "1: profile is missing: a profile needs its name and its rules"),
        ("profile: mine", "profile: 7", "1: profile is 7: need words"),
        ("minimum_height: 12", "minimum_height: x", "2: minimum_height is 'x': need a number"),
        (
            "below_minimum: nothing",
            "below_minimum: 3",
            "3: below_minimum is 3: need deploy or kill or nothing",
        ),
        ("moving_speed: 3.5", "moving_speed: x", "4: moving_speed is 'x': need a number"),
        ("landed_hold: 1.5", "landed_hold: x", "5: landed_hold is 'x': need a number"),
        (
            "  height: {max",
            "  zzz: {max",
            f"7: measurements has no 'zzz': it may have {', '.join(STANDARD_LIMITS)}",
        ),
        (
            "maximum: 9000",
            "zzz: 9000",
            f"7: measurement height has no 'zzz': it may have {LIMIT_KEYS}",
        ),
        (
            "landed_hold: 1.5",
            "zzz: 1.5",
            f"5: a profile has no 'zzz': it may have {PROFILE_KEYS}",
        ),
        (
            "source: ours",
            "zzz: ours",
            f"12: rule 'falls' has no 'zzz': it may have {RULE_KEYS}",
        ),
        (
            "{autopilot: rebooted}",
            "{autopilot: rebooted, zzz: 1}",
            f"18: a condition of rule 'falls' has no 'zzz': it may have {CONDITION_KEYS}",
        ),
        ("says: it falls,\n      fast", "says: 7", "10: says of rule 'falls' is 7: need words"),
        ("source: ours", "source: 7", "12: source of rule 'falls' is 7: need words"),
        (
            "states: [IN_FLIGHT, KILLING]",
            "states: []",
            "13: states of rule 'falls' is empty: need at least one",
        ),
        (
            "states: IN_FLIGHT",
            "states: 7",
            f"27: a state of rule 'silent' is 7: need {' or '.join(Stage.__members__)}",
        ),
        (
            "conditions: {link: mavlink_parachute, is: LOST}",
            "conditions: []",
            "28: conditions of rule 'silent' is empty: need at least one",
        ),
        (
            "states: [IN_FLIGHT, KILLING]",
            "states: [READY]",
            f"9: rule 'falls' would deploy out of flight, which is never done: {FLYING}",
        ),
        ("weight: 2}", "weight: x}", "15: weight in rule 'falls' is 'x': need a number"),
        (
            "below: -12.5",
            "below: x",
            "15: below of vertical_speed in rule 'falls' is 'x': need a number",
        ),
        (
            "above: 60, below: 170",
            "above: x",
            "16: above of tilt_deg in rule 'falls' is 'x': need a number",
        ),
        (
            "measurement: vertical_speed",
            "measurement: x",
            f"15: measurement in rule 'falls' is 'x': need {' or '.join(MEASUREMENTS)}",
        ),
        ("weight: 2}", "is: LOST}", "15: `is` belongs to a link: use above or below"),
        (
            ", below: -12.5",
            "",
            "15: vertical_speed in rule 'falls' has no limit: add above or below",
        ),
        (
            "above: 60",
            "above: 170",
            "16: tilt_deg in rule 'falls' can never be: above must be less than below",
        ),
        (
            ", is: [STALE, LOST]",
            "",
            f"17: a condition of rule 'falls' on a link needs `is`: one or more of {JUDGEMENTS}",
        ),
        (
            "is: [STALE, LOST]",
            "is: [STALE, 7]",
            f"17: is in rule 'falls' is 7: need {JUDGEMENTS.replace(', ', ' or ')}",
        ),
        ("is: LOST}", "is: []}", "28: is in rule 'silent' is empty: need at least one"),
        (
            "{link: any, is",
            "{link: 7, is",
            "17: link in rule 'falls' is 7: need any or all or mavlink_parachute or upf_can",
        ),
        (
            "{autopilot: rebooted}",
            "{autopilot: 7}",
            f"18: autopilot in rule 'falls' is 7: need {FACTS}",
        ),
        (
            "{autopilot: rebooted}",
            "{autopilot: lost, above: 1}",
            "18: above belongs to a measurement: remove it here",
        ),
        (
            "{autopilot: rebooted}",
            "{autopilot: lost, below: 1}",
            "18: below belongs to a measurement: remove it here",
        ),
        (
            "{autopilot: rebooted}",
            "{autopilot: lost, is: OK}",
            "18: `is` belongs to a link: remove it here",
        ),
        (
            "link: upf_can, weight",
            "link: upf_can, is: OK, weight",
            "19: `is` belongs to a link: remove it here",
        ),
        ("{autopilot: rebooted}", "{weight: 1}", f"18: a condition of rule 'falls' {KINDS} none"),
        (
            "{autopilot: rebooted}",
            "{autopilot: lost, link: any, is: LOST}",
            f"18: a condition of rule 'falls' {KINDS} link, autopilot",
        ),
        (
            "{measurement: tilt_deg, above",
            "{measurement: tilt_deg, device: abnormal, above",
            f"16: a condition of rule 'falls' {KINDS} measurement, device",
        ),
        (
            "device: abnormal",
            "device: 7",
            "19: device in rule 'falls' is 7: need asks_for_kill or deployed or abnormal",
        ),
        (
            "link: upf_can",
            "link: 7",
            "19: link in rule 'falls' is 7: need any or mavlink_parachute or upf_can",
        ),
        ("needed: 3", "needed: x", "20: needed of rule 'falls' is 'x': need a number"),
        ("for: 0.5", "for: x", "21: for of rule 'falls' is 'x': need a number"),
        ("leak: 0.25", "leak: x", "22: leak of rule 'falls' is 'x': need a number"),
        ("samples: 3", "samples: x", "23: samples of rule 'falls' is 'x': need a number"),
        (
            "clears: on_disarm",
            "clears: 7",
            "25: clears of rule 'falls' is 7: need never or on_disarm or by_itself",
        ),
        ("    action: ALARM\n", "", "26: rule 'silent' has no action: add it"),
        ("    states: IN_FLIGHT\n", "", "26: rule 'silent' has no states: add it"),
    ],
)
def test_each_mistake_is_told_in_full_and_nothing_besides(old: str, new: str, told: str) -> None:
    assert spoilt(old, new) == [f"line {told}"]
