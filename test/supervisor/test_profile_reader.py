"""A profile is checked when it is read: each mistake with its line and the fix."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import LINK, PROFILES

from chute_ros.errors import ProfileError
from chute_ros.model import Action, Airframe
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import STANDARD_LIMITS
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.rules import BelowMinimum, Clears, Profile, Rule

LINKS = (LINK, "upf_can")
WHOLE = """\
profile: mine
minimum_height: 12
below_minimum: nothing
moving_speed: 3.5
landed_hold: 1.5
measurements:
  height: {maximum: 9000, jump: 20.0}
rules:
  falls:
    says: it falls,
      fast
    source: ours
    states: [IN_FLIGHT, KILLING]
    conditions:
      - {measurement: vertical_speed, below: -12.5, weight: 2}
      - {measurement: tilt_deg, above: 60, below: 170}
      - {link: any, is: [STALE, LOST]}
      - {autopilot: rebooted}
      - {device: abnormal, link: upf_can, weight: 0.5}
    needed: 3
    for: 0.5
    leak: 0.25
    samples: 3
    action: DEPLOY
    clears: on_disarm
  silent:
    states: IN_FLIGHT
    conditions: {link: mavlink_parachute, is: LOST}
    action: ALARM
"""


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


def read(text: str) -> Profile:
    return read_profile(text, "mine.yaml", LINKS)


def mistakes(text: str) -> list[str]:
    with pytest.raises(ProfileError) as caught:
        read(text)
    return str(caught.value).splitlines()


def wrong(text: str) -> str:
    """Every mistake, or that there is none."""
    try:
        read(text)
    except ProfileError as error:
        return str(error)
    return "nothing is wrong"


@pytest.mark.parametrize(("line", "low"), [("", 0.0), ("low_height: 35.5\n", 35.5)])
def test_a_low_height_is_read_and_nothing_is_low_without_one(line, low):
    assert read(WHOLE.replace("moving_speed", f"{line}moving_speed")).low_height == low


def test_what_is_written_is_what_is_read():
    profile = read(WHOLE)
    assert profile.name == "mine"
    assert profile.minimum_height == 12.0
    assert profile.below_minimum is BelowMinimum.NOTHING
    assert profile.moving_speed == 3.5
    assert profile.landed_hold == 1.5
    assert profile.limits["height"].maximum == 9000.0
    assert profile.limits["height"].jump == 20.0
    assert profile.limits["height"].rate == STANDARD_LIMITS["height"].rate
    assert profile.limits["tilt_deg"] == STANDARD_LIMITS["tilt_deg"]
    falls, silent = profile.rules
    # A limit that is not asked for is NaN, which is not equal to itself; its text is.
    assert repr(falls) == repr(FALLS)
    assert (silent.action, silent.states) == (Action.NONE, (Stage.IN_FLIGHT,))
    assert silent.conditions == (LinkCondition(LINK, (LinkJudgement.LOST,)),)
    assert (silent.needed, silent.hold, silent.leak, silent.samples) == (1.0, 0.0, 0.5, 1)
    assert silent.clears is Clears.NEVER


def test_a_condition_may_go_on_until_another_limit():
    one = read(WHOLE.replace("below: -12.5", "below: -12.5, until: -3")).rules[0].conditions[0]
    assert isinstance(one, MeasurementCondition)
    assert one.until == -3.0
    assert one.limits == "below -12.5, then until -3"
    assert one.lingers(-3.1)
    assert not one.lingers(-3.0)
    one = read(WHOLE.replace("below: -12.5", "above: 9, until: 5")).rules[0].conditions[0]
    assert isinstance(one, MeasurementCondition)
    assert one.limits == "above 9, then until 5"
    assert one.lingers(5.1)
    assert not one.lingers(5.0)
    assert not MeasurementCondition("tilt_deg", below=3.0).lingers(2.0)


def test_without_needed_all_conditions_must_hold():
    assert read(WHOLE.replace("    needed: 3\n", "")).rules[0].needed == pytest.approx(5.5)


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("leak: 0.25", "doubted: 1.5", 22, "doubted of rule 'falls' is 1.5: need 0 to 1"),
        ("leak: 0.25", "doubted: -0.1", 22, "doubted of rule 'falls' is -0.1: need 0 to 1"),
        ("rebooted}", "rebooted, counted: 2}", 18, "counted of rebooted in rule 'falls' is 2"),
        ("abnormal,", "abnormal, counted: false,", 19, "counted belongs to the autopilot"),
        ("abnormal,", "abnormal, until: 3,", 19, "until belongs to a measurement: remove it here"),
        ("below: -12.5", "below: -12.5, until: -12.5", 15, "is -12.5: need more than below"),
        ("below: -12.5", "above: -12.5, until: -12.5", 15, "is -12.5: need less than above"),
        ("below: -12.5", "below: -12.5, until: soon", 15, "until of vertical_speed in rule"),
        ("above: 60,", "above: 60, until: 50,", 16, "until of tilt_deg in rule 'falls' belongs"),
        ("profile: mine", "profile: ''", 1, "profile is '': need words"),
        ("minimum_height: 12", "minimum_height: '12'", 2, "'12': need a number"),
        ("minimum_height: 12", "minimum_height: .nan", 2, "is nan: need 0 to 1000"),
        ("minimum_height: 12", "minimum_height: 2024-13-45", 2, "'2024-13-45': need a number"),
        ("minimum_height: 12", "minimum_height: =", 2, "'=': need a number"),
        ("minimum_height: 12", "minimum_height: [1]", 2, "'a list': need a number"),
        ("maximum: 9000", "maximum: -501", 7, "height: range -500.0 to -501.0: need a larger"),
        ("{maximum: 9000, jump: 20.0}", "9000", 7, "is 9000: need `key: value` lines"),
        ("below: -12.5", "below: .nan", 15, "is nan: need a finite number"),
        ("{autopilot: rebooted}", "lost", 18, "a condition of rule 'falls' is 'lost'"),
    ],
)
def test_each_mistake_is_told_with_its_line_and_the_fix(old, new, line, words):
    assert WHOLE.count(old) >= 1
    told = mistakes(WHOLE.replace(old, new, 1))
    at = [one for one in told if one.startswith(f"mine.yaml, line {line}: ")]
    assert any(words in one for one in at), told


def test_a_deploy_without_states_is_told_only_that():
    told = mistakes(WHOLE.replace("    states: [IN_FLIGHT, KILLING]\n", ""))
    assert told == ["mine.yaml, line 9: rule 'falls' has no states: add it"]


def test_a_rule_without_conditions_is_told_only_that():
    text = "profile: p\nrules:\n  a:\n    states: READY\n    action: DEPLOY\n    needed: 2\n"
    assert mistakes(text) == ["mine.yaml, line 3: rule 'a' has no conditions: add it"]


def test_every_mistake_is_told_at_once():
    text = WHOLE.replace("12.5", "fast").replace("leak: 0.25", "leak: x").replace("DEPLOY", "D")
    told = mistakes(text)
    assert [one.split(":")[0] for one in told] == [
        "mine.yaml, line 15",
        "mine.yaml, line 24",
        "mine.yaml, line 22",
    ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: a profile is None: need `key: value` lines"),
        ("- a\n- b\n", "line 1: a profile is 'a list'"),
        ("just words", "line 1: a profile is 'just words'"),
        ("profile: p\nrules:\n", "line 2: rules is None: need `key: value` lines"),
        ("profile: p\n", "line 1: rules is missing"),
        ("profile: p\nrules: {a: 3}\n", "line 2: rule 'a' is 3: need `key: value` lines"),
        ("profile: p\n rules: {\n", "line 2: not YAML: mapping values are not allowed here"),
        ("profile: [p\n", "not YAML: "),
        ("profile: \x00\n", "line 1: not YAML: "),
        ("---\na: 1\n---\nb: 2\n", "line 3: not YAML: but found another document"),
        ("profile: *nobody\n", "line 1: not YAML: found undefined alias"),
        ("[" * 3000, "line 1: not YAML: it is nested too deep"),
        ("a: " + "{a: " * 1500, "line 1: not YAML: it is nested too deep"),
        ("? [a]\n: 1\n", "line 1: a key of a profile is no word"),
    ],
)
def test_what_is_no_profile_at_all_says_so(text, words):
    assert any(words in one for one in mistakes(text))


@given(st.text(max_size=200))
def test_no_text_raises_anything_else(text):
    with pytest.raises(ProfileError):
        read(text)


LINES = WHOLE.splitlines()


@given(
    st.integers(0, len(LINES) - 1),
    st.one_of(
        st.just(""),
        st.sampled_from(["  x: 1", "- 1", "rules: 3", "}", "    for: [", "\t", "? a", "a: &b *b"]),
        st.text(max_size=30),
    ),
)
def test_a_line_that_is_spoilt_is_a_profile_all_the_same_or_a_mistake_with_a_line(number, instead):
    text = "\n".join([*LINES[:number], instead, *LINES[number + 1 :]])
    assert wrong(text).startswith(("mine.yaml, line ", "nothing"))


@given(
    st.sampled_from([w for w in WHOLE.replace("\n", " ").split(" ") if w and w[0] not in "{[-"]),
    st.sampled_from([".inf", "-.inf", "1e400", "0x_", "2024-99-99", "~", "!!int x", "=", "<<"]),
)
def test_a_value_that_is_no_value_raises_nothing_else(word, value):
    assert wrong(WHOLE.replace(word, value, 1)).startswith(("mine.yaml, line ", "nothing"))


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing", "rocket"])
def test_each_shipped_profile_has_no_mistake_and_says_what_and_wherefrom(name):
    text = (PROFILES / f"{name}.yaml").read_text(encoding="utf-8")
    profile = read(text)
    assert profile.name == name
    for rule in profile.rules:
        assert rule.says
        assert rule.source


@pytest.mark.parametrize("name", ['""', '"  "'])
def test_a_rule_has_a_name(name):
    """Decisions are known by it: one without would kill, and never deploy."""
    (told,) = mistakes(WHOLE.replace("  falls:", f"  {name}:", 1))
    assert "a rule has no name, by which its decisions are known: name it" in told


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("tilt_deg, below: 180", "tilt_deg 3"),
        ("tilt_deg, above: 0", "tilt_deg 3"),
        ("acceleration, above: 0", "acceleration 9.81"),
        ("vertical_speed, above: -399.9", "vertical_speed 0"),
        ("height, above: -499", "height 30"),
    ],
)
def test_a_rule_that_holds_in_a_hover_ends_no_flight(limit, told):
    text = ALWAYS_TRUE.format(limit, "DEPLOY")
    (wrong,) = mistakes(text)
    assert wrong.endswith(
        f"rule 'r' ends a flight in which nothing is wrong: it holds in a hover ({told})"
    )
    read_profile(ALWAYS_TRUE.format(limit, "ALARM"), "mine.yaml", LINKS)


ALWAYS_TRUE = """profile: x
rules:
  r:
    states: [IN_FLIGHT]
    conditions: [{{measurement: {}}}]
    for: 0.5
    action: {}
"""


@pytest.mark.parametrize("key", ["max_age", "rate", "jump"])
def test_a_limit_that_no_measurement_keeps_is_refused(key):
    """Each change would be a jump, each word too old."""
    text = WHOLE.replace("{maximum: 9000, jump: 20.0}", f"{{{key}: 0.0001}}")
    (wrong,) = mistakes(text)
    assert f"{key} of height is 0.0001: need " in wrong


def test_no_rule_has_a_persons_name():
    """What a person orders passes below the minimum height."""
    (told,) = mistakes(WHOLE.replace("  falls:", "  operator:"))
    assert told == (
        "mine.yaml, line 9: rule 'operator' has a person's name, whom no height holds back: "
        "rename it"
    )


@pytest.mark.parametrize("number", ["1" + "0" * 400, "0x" + "f" * 4000])
def test_a_number_that_no_float_holds_is_no_number(number):
    assert any("need a number" in one for one in mistakes(WHOLE.replace("-12.5", number, 1)))


def test_a_key_that_aliases_make_endless_is_not_spelt_out():
    """Nine times as long with each line: the last one would fill the memory."""
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    for before, name in zip("abcdefghijk", "bcdefghijkl", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]")
    (told,) = [one for one in mistakes("\n".join([*lines, "? *l", ": 1"])) if "no word" in one]
    assert told.startswith("mine.yaml, line 12: a key of a profile is no word")


def test_what_is_in_doubt_counts_in_full_and_all_is_counted_unless_it_says_so():
    falls = read(WHOLE).rules[0]
    assert falls.doubted == 1.0
    assert all(one.counted for one in falls.conditions)
    text = WHOLE.replace("leak: 0.25", "doubted: 0.25").replace("on_disarm", "never")
    falls = read(text.replace("rebooted}", "lost, counted: false}")).rules[0]
    assert falls.doubted == 0.25
    assert [one.counted for one in falls.conditions] == [True, True, True, False, True]


def test_a_rule_that_would_be_full_at_once_again_is_refused():
    text = WHOLE.replace("rebooted}", "rebooted, counted: false}")
    assert "with `counted: false` it clears never" in wrong(text)


def test_a_rule_that_counts_nothing_is_refused():
    silent = "conditions: {link: mavlink_parachute, is: LOST}"
    lost = "conditions: {autopilot: lost, counted: false}"
    assert "rule 'silent' counts nothing" in wrong(WHOLE.replace(silent, lost))


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


def test_a_link_may_be_all_and_a_device_on_any():
    assert rule(conditions="{link: all, is: LOST, weight: 2}").conditions == (
        LinkCondition("all", (LinkJudgement.LOST,), 2.0),
    )
    assert rule(conditions="{autopilot: lost, weight: 3}").conditions == (
        AutopilotCondition(AutopilotFact.LOST, 3.0),
    )
    for text in ("{device: deployed}", "{device: deployed, link: any}"):
        assert rule(conditions=text).conditions == (DeviceCondition(DeviceFact.DEPLOYED),)


def test_every_word_for_an_action_is_what_it_says():
    words = {"ALARM": Action.NONE, "FLIGHT_BLOCK": Action.FLIGHT_BLOCK}
    for word, action in {**words, "KILL": Action.KILL, "DEPLOY": Action.DEPLOY}.items():
        assert rule(action=word).action is action


def test_every_word_for_what_happens_below_the_minimum_is_what_it_says():
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
def test_a_number_of_the_profile_may_reach_its_limits(key, least, most, less, more):
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
def test_a_number_of_a_rule_may_reach_its_limits(key, field, least, most, less, more):
    conditions = "{autopilot: rebooted, weight: 1000000}"
    for good in (least, most):
        assert getattr(rule(conditions=conditions, **{key: f"{good:.6f}"}), field) == good
    for wrong in (less, more):
        with pytest.raises(ProfileError) as caught:
            rule(conditions=conditions, **{key: wrong})
        said = f"{key} of rule 'a' is {float(wrong)}: need {least:g} to {most:g}"
        assert f"mine.yaml, line 7: {said}" in str(caught.value).splitlines()


def test_samples_are_counted_in_whole_numbers_up_to_fifty():
    for good in (1, 2, 50):
        samples = rule(samples=str(good), **{"for": "0.1"}).samples
        assert (samples, type(samples)) == (good, int)
    for wrong, need in (("51", "1 to 50"), ("0", "1 to 50"), ("1.5", "a whole number")):
        with pytest.raises(ProfileError) as caught:
            rule(samples=wrong)
        said = f"mine.yaml, line 7: samples of rule 'a' is {wrong}: need {need}"
        assert str(caught.value) == said


def test_more_than_one_sample_needs_a_time_in_which_they_come():
    with pytest.raises(ProfileError, match="rule 'a' needs 2 samples at once"):
        rule(samples="2")
    said = "rule 'falls' needs 3 samples at once: add `for`, in which they may come"
    assert spoilt("    for: 0.5\n", "") == [f"line 22: {said}"]
    assert spoilt("for: 0.5", "for: 0") == [f"line 23: {said}"]
    assert rule(samples="1").samples == 1


def test_a_weight_may_reach_its_limits():
    for good in ("0.000001", "1000000"):
        condition = f"{{autopilot: rebooted, weight: {good}}}"
        assert rule(conditions=condition).needed == float(good)
    for wrong in ("0.0000005", "1000000.5"):
        with pytest.raises(ProfileError) as caught:
            rule(conditions=f"{{autopilot: rebooted, weight: {wrong}}}")
        said = f"mine.yaml, line 5: weight in rule 'a' is {float(wrong)}: need 1e-06 to 1e+06"
        assert str(caught.value) == said


def test_as_much_as_all_conditions_weigh_may_be_needed_and_no_more():
    assert read(WHOLE.replace("needed: 3", "needed: 5.5")).rules[0].needed == 5.5
    said = "the weights of its conditions add up to only 5.5"
    assert rule(needed="1.000000001").needed == 1.000000001, "that is rounding"
    (told,) = spoilt("needed: 3", "needed: 5.6")
    assert told == f"line 20: needed of rule 'falls' is 5.6: {said}"


def test_silence_may_add_to_a_deploy_but_never_be_all_of_it():
    assert read(WHOLE.replace("needed: 3", "needed: 1.1")).rules[0].needed == 1.1
    lost = WHOLE.replace("autopilot: rebooted", "autopilot: lost")
    said = "rule 'falls' would deploy on silence alone, which is never done"
    assert mistakes(lost.replace("needed: 3", "needed: 1.9")) == [
        f"mine.yaml, line 9: {said}: raise needed above 2, or add a measurement"
    ]
    with pytest.raises(ProfileError, match=r"above 1, or add a measurement"):
        rule(conditions="{link: any, is: LOST}", needed="1.000000001", action="DEPLOY")
    assert rule(conditions="{link: any, is: LOST}").action is Action.KILL, "motors may stop so"


def test_a_mistake_in_the_rules_is_told_after_one_in_the_measurements():
    text = WHOLE.replace("jump: 20.0", "jump: -1").replace("action: ALARM", "action: ALERT")
    need = "need ALARM or FLIGHT_BLOCK or KILL or DEPLOY (did you mean ALARM?)"
    assert mistakes(text) == [
        "mine.yaml, line 7: jump of height is -1: need 0.5 to 200",
        f"mine.yaml, line 29: action of rule 'silent' is 'ALERT': {need}",
    ]


def test_a_limit_that_is_no_number_says_of_what():
    assert "line 7: jump of height is 'x': need a number" in spoilt("jump: 20.0", "jump: x")


@pytest.mark.parametrize("name", STANDARD_LIMITS)
def test_every_measurement_may_have_limits_of_its_own(name):
    limits = read(f"{ONE_RULE}\nmeasurements: {{{name}: {{max_age: 3}}}}").limits
    assert limits[name].max_age == 3.0
    assert {**limits, name: None} == {**STANDARD_LIMITS, name: None}


def test_what_is_no_profile_names_its_file_and_what_is_no_rules_says_so():
    assert mistakes("profile: [p\n---\n")[0].startswith("mine.yaml, line 2: not YAML: ")
    need = "need `key: value` lines"
    assert mistakes("profile: p\nrules: 3\n") == [f"mine.yaml, line 2: rules is 3: {need}"]


def test_without_any_link_only_any_can_be_named():
    text = WHOLE.replace("link: upf_can", "link: x")
    with pytest.raises(ProfileError) as caught:
        read_profile(text, "mine.yaml", ())
    assert "mine.yaml, line 19: link in rule 'falls' is 'x': need any" in str(caught.value)


def test_what_a_mistake_stands_for_meanwhile_is_no_second_mistake():
    """A word that is not known is no silence; the deploy is looked at once it is put right."""
    text = (
        "profile: p\nrules:\n  a:\n    states: KILLING\n    action: DEPLOY\n"
        "    conditions: {autopilot: killed_aloof}\n"
    )
    (only,) = mistakes(text)
    assert "(did you mean killed_aloft?)" in only


FACTS = "lost or rebooted or disarmed or emergency or killed_aloft or motors_stopped"
MEASUREMENTS = (
    *STANDARD_LIMITS,
    "climb_rate",
    "vertical_acceleration",
    "felt_drop",
    "felt_fall",
    "speed_error",
    "force_error",
)
JUDGEMENTS = "NEVER_SEEN, OK, STALE, LOST, REGAINED, UNMONITORED"
PROFILE_KEYS = (
    "profile, vehicle, minimum_height, below_minimum, low_height, moving_speed, landed_hold, "
    "measurements, rules"
)
RULE_KEYS = "says, source, states, conditions, needed, for, leak, samples, doubted, action, clears"
CONDITION_KEYS = (
    "measurement, link, autopilot, device, above, below, until, if_unknown, unless_dived, is, "
    "counted, weight"
)
LIMIT_KEYS = "minimum, maximum, rate, jump, max_age, stuck_after"
FLYING = "its states may be IN_FLIGHT, KILLING, DEPLOYED and FAULT"
KINDS = "needs one of measurement, link, autopilot, device; it has"


@pytest.mark.parametrize(
    ("spoils", "told"),
    [
        ("profile: mine\n -> ", "1: profile is missing: a profile needs its name and its rules"),
        ("profile: mine -> profile: 7", "1: profile is 7: need words"),
        ("minimum_height: 12 -> minimum_height: x", "2: minimum_height is 'x': need a number"),
        (
            "below_minimum: nothing -> below_minimum: 3",
            "3: below_minimum is 3: need deploy or kill or nothing",
        ),
        ("moving_speed: 3.5 -> moving_speed: x", "4: moving_speed is 'x': need a number"),
        ("landed_hold: 1.5 -> landed_hold: x", "5: landed_hold is 'x': need a number"),
        (
            "  height: {max ->   zzz: {max",
            f"7: measurements has no 'zzz': it may have {', '.join(STANDARD_LIMITS)}",
        ),
        (
            "maximum: 9000 -> zzz: 9000",
            f"7: measurement height has no 'zzz': it may have {LIMIT_KEYS}",
        ),
        ("landed_hold: 1.5 -> zzz: 1.5", f"5: a profile has no 'zzz': it may have {PROFILE_KEYS}"),
        ("source: ours -> zzz: ours", f"12: rule 'falls' has no 'zzz': it may have {RULE_KEYS}"),
        (
            "{autopilot: rebooted} -> {autopilot: rebooted, zzz: 1}",
            f"18: a condition of rule 'falls' has no 'zzz': it may have {CONDITION_KEYS}",
        ),
        ("says: it falls,\n      fast -> says: 7", "10: says of rule 'falls' is 7: need words"),
        ("source: ours -> source: 7", "12: source of rule 'falls' is 7: need words"),
        (
            "states: [IN_FLIGHT, KILLING] -> states: []",
            "13: states of rule 'falls' is empty: need at least one",
        ),
        (
            "states: IN_FLIGHT -> states: 7",
            f"27: a state of rule 'silent' is 7: need {' or '.join(Stage.__members__)}",
        ),
        (
            "conditions: {link: mavlink_parachute, is: LOST} -> conditions: []",
            "28: conditions of rule 'silent' is empty: need at least one",
        ),
        (
            "states: [IN_FLIGHT, KILLING] -> states: [READY]",
            f"9: rule 'falls' would deploy out of flight, which is never done: {FLYING}",
        ),
        ("weight: 2} -> weight: x}", "15: weight in rule 'falls' is 'x': need a number"),
        (
            "below: -12.5 -> below: x",
            "15: below of vertical_speed in rule 'falls' is 'x': need a number",
        ),
        (
            "above: 60, below: 170 -> above: x",
            "16: above of tilt_deg in rule 'falls' is 'x': need a number",
        ),
        (
            "measurement: vertical_speed -> measurement: x",
            f"15: measurement in rule 'falls' is 'x': need {' or '.join(MEASUREMENTS)}",
        ),
        ("weight: 2} -> is: LOST}", "15: `is` belongs to a link: use above or below"),
        (
            ", below: -12.5 -> ",
            "15: vertical_speed in rule 'falls' has no limit: add above or below",
        ),
        (
            "above: 60 -> above: 170",
            "16: tilt_deg in rule 'falls' can never be: above must be less than below",
        ),
        (
            ", is: [STALE, LOST] -> ",
            f"17: a condition of rule 'falls' on a link needs `is`: one or more of {JUDGEMENTS}",
        ),
        (
            "is: [STALE, LOST] -> is: [STALE, 7]",
            f"17: is in rule 'falls' is 7: need {JUDGEMENTS.replace(', ', ' or ')}",
        ),
        ("is: LOST} -> is: []}", "28: is in rule 'silent' is empty: need at least one"),
        (
            "{link: any, is -> {link: 7, is",
            "17: link in rule 'falls' is 7: need any or all or mavlink_parachute or upf_can",
        ),
        (
            "{autopilot: rebooted} -> {autopilot: 7}",
            f"18: autopilot in rule 'falls' is 7: need {FACTS}",
        ),
        (
            "{autopilot: rebooted} -> {autopilot: lost, above: 1}",
            "18: above belongs to a measurement: remove it here",
        ),
        (
            "{autopilot: rebooted} -> {autopilot: lost, below: 1}",
            "18: below belongs to a measurement: remove it here",
        ),
        (
            "{autopilot: rebooted} -> {autopilot: lost, is: OK}",
            "18: `is` belongs to a link: remove it here",
        ),
        (
            "link: upf_can, weight -> link: upf_can, is: OK, weight",
            "19: `is` belongs to a link: remove it here",
        ),
        ("{autopilot: rebooted} -> {weight: 1}", f"18: a condition of rule 'falls' {KINDS} none"),
        (
            "{autopilot: rebooted} -> {autopilot: lost, link: any, is: LOST}",
            f"18: a condition of rule 'falls' {KINDS} link, autopilot",
        ),
        (
            "{measurement: tilt_deg, above -> {measurement: tilt_deg, device: abnormal, above",
            f"16: a condition of rule 'falls' {KINDS} measurement, device",
        ),
        (
            "device: abnormal -> device: 7",
            (
                "19: device in rule 'falls' is 7: need asks_for_kill or deployed or abnormal or "
                "nothing_out or drogue_out"
            ),
        ),
        (
            "link: upf_can -> link: 7",
            "19: link in rule 'falls' is 7: need any or mavlink_parachute or upf_can",
        ),
        ("needed: 3 -> needed: x", "20: needed of rule 'falls' is 'x': need a number"),
        ("for: 0.5 -> for: x", "21: for of rule 'falls' is 'x': need a number"),
        ("leak: 0.25 -> leak: x", "22: leak of rule 'falls' is 'x': need a number"),
        ("samples: 3 -> samples: x", "23: samples of rule 'falls' is 'x': need a number"),
        (
            "clears: on_disarm -> clears: 7",
            "25: clears of rule 'falls' is 7: need never or on_disarm or by_itself",
        ),
        ("    action: ALARM\n -> ", "26: rule 'silent' has no action: add it"),
        ("    states: IN_FLIGHT\n -> ", "26: rule 'silent' has no states: add it"),
    ],
)
def test_each_mistake_is_told_in_full_and_nothing_besides(spoils, told):
    assert spoilt(*spoils.split(" -> ")) == [f"line {told}"]


def test_what_a_profile_is_for_is_a_word_of_four():
    text = "profile: mine\nvehicle: {}\nrules: {{}}\n"
    for kind in Airframe:
        with pytest.raises(ProfileError) as told:
            read_profile(text.format(kind.value), "mine.yaml", LINKS)
        assert "vehicle" not in str(told.value), "only that there is no rule"
    with pytest.raises(ProfileError, match="line 2: vehicle is 'plane': need any or multirotor"):
        read_profile(text.format("plane"), "mine.yaml", LINKS)
