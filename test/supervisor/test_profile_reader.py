"""A profile is checked when it is read: each mistake with its line and the fix."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import LINK, PROFILES

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
def test_a_low_height_is_read_and_nothing_is_low_without_one(line: str, low: float) -> None:
    assert read(WHOLE.replace("moving_speed", f"{line}moving_speed")).low_height == low


def test_what_is_written_is_what_is_read() -> None:
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
    assert falls == Rule(
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
    ) or str(falls.conditions[0]) == str(  # NaN, which is not equal to itself
        MeasurementCondition("vertical_speed", below=-12.5, weight=2.0)
    )
    assert (silent.action, silent.states) == (Action.NONE, (Stage.IN_FLIGHT,))
    assert silent.conditions == (LinkCondition(LINK, (LinkJudgement.LOST,)),)
    assert (silent.needed, silent.hold, silent.leak, silent.samples) == (1.0, 0.0, 0.5, 1)
    assert silent.clears is Clears.NEVER


def test_a_condition_may_go_on_until_another_limit() -> None:
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


def test_without_needed_all_conditions_must_hold() -> None:
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
        (
            "above: 60,",
            "above: 60, until: 50,",
            16,
            "until of tilt_deg in rule 'falls' belongs",
        ),
        ("profile: mine\n", "", 1, "profile is missing: a profile needs its name and its rules"),
        ("profile: mine", "profile: 7", 1, "profile is 7: need words"),
        ("profile: mine", "profile: ''", 1, "profile is '': need words"),
        ("minimum_height: 12", "minimum_height: high", 2, "'high': need a number"),
        ("minimum_height: 12", "minimum_height: true", 2, "True: need a number"),
        ("minimum_height: 12", "minimum_height: '12'", 2, "'12': need a number"),
        ("minimum_height: 12", "minimum_height: -1", 2, "is -1: need 0 to 1000"),
        ("minimum_height: 12", "minimum_height: .nan", 2, "is nan: need 0 to 1000"),
        ("minimum_height: 12", "minimum_height: 2024-13-45", 2, "'2024-13-45': need a number"),
        ("minimum_height: 12", "minimum_height: =", 2, "'=': need a number"),
        ("minimum_height: 12", "minimum_height: [1]", 2, "'a list': need a number"),
        ("minimum_height", "minimum_hight", 2, "no 'minimum_hight': did you mean minimum_height?"),
        ("minimum_height: 12", "low_height: -1", 2, "low_height is -1: need 0 to 1000"),
        ("below_minimum: nothing", "below_minimum: kil", 3, "(did you mean kill?)"),
        ("below_minimum: nothing", "below_minimum: 3", 3, "need deploy or kill or nothing"),
        ("moving_speed: 3.5", "moving_speed: 0", 4, "is 0: need 0.1 to 20"),
        ("landed_hold: 1.5", "landed_hold: 61", 5, "is 61: need 0 to 60"),
        ("landed_hold: 1.5", "moving_speed: 2", 5, "'moving_speed' is there twice: remove one"),
        ("height: {max", "hight: {max", 7, "no 'hight': did you mean height?"),
        ("maximum: 9000", "maximum: -501", 7, "height: range -500.0 to -501.0: need a larger"),
        ("maximum: 9000", "most: 9000", 7, "measurement height has no 'most': it may have min"),
        ("{maximum: 9000, jump: 20.0}", "9000", 7, "is 9000: need `key: value` lines"),
        ("jump: 20.0", "jump: -1", 7, "jump of height is -1: need 0 to 200"),
        ("  falls:", "  falls: {}\n  fails:", 9, "rule 'falls' has no action: add it"),
        ("says: it falls,\n      fast", "says: [a]\n    # b", 10, "is 'a list': need words"),
        ("source: ours", "sauce: ours", 12, "has no 'sauce': did you mean source?"),
        ("states: [IN_FLIGHT, K", "states: [INFLIGHT, K", 13, "(did you mean IN_FLIGHT?)"),
        ("states: [IN_FLIGHT, KILLING]", "states: []", 13, "is empty: need at least one"),
        (
            "states: [IN_FLIGHT, KILLING]",
            "states: [READY]",
            9,
            "its states may be IN_FLIGHT, KILLING and",
        ),
        ("below: -12.5", "below: .nan", 15, "is nan: need a finite number"),
        ("measurement: vertical_speed", "measurement: speed", 15, "is 'speed': need height or"),
        ("weight: 2}", "weight: 0}", 15, "weight in rule 'falls' is 0: need 1e-06 to 1e+06"),
        ("weight: 2}", "is: LOST}", 15, "`is` belongs to a link: use above or below"),
        (", below: -12.5", "", 15, "has no limit: add above or below"),
        ("above: 60,", "above: 170,", 16, "can never be: above must be less than below"),
        ("is: [STALE, LOST]", "is: [STALE, LOOST]", 17, "(did you mean LOST?)"),
        (", is: [STALE, LOST]", "", 17, "needs `is`: one or more of NEVER_SEEN, OK, STALE, LOST"),
        ("link: any, is", "link: mavlink, is", 17, "need any or all or mavlink_parachute or upf"),
        ("{autopilot: rebooted}", "{autopilot: reboot}", 18, "(did you mean rebooted?)"),
        ("{autopilot: rebooted}", "{autopilot: lost, above: 1}", 18, "above belongs to a meas"),
        ("{autopilot: rebooted}", "{autopilot: lost, is: OK}", 18, "`is` belongs to a link"),
        ("{autopilot: rebooted}", "{weight: 1}", 18, "measurement, link, autopilot, device; it"),
        ("{autopilot: rebooted}", "{autopilot: lost, link: any, is: LOST}", 18, "it has link, a"),
        ("{autopilot: rebooted}", "lost", 18, "a condition of rule 'falls' is 'lost'"),
        ("device: abnormal", "device: broken", 19, "need asks_for_kill or deployed or abnormal"),
        ("link: upf_can", "link: upf_cam", 19, "is 'upf_cam': need any or mavlink_parachute or u"),
        ("needed: 3", "needed: 9", 20, "is 9: the weights of its conditions add up to only 5.5"),
        ("needed: 3", "needed: 0", 20, "is 0: need 1e-06 to 1e+06"),
        ("needed: 3", "needed: 1", 9, "silence alone, which is never done: raise needed above 1"),
        ("for: 0.5", "for: 61", 21, "for of rule 'falls' is 61: need 0 to 60"),
        ("leak: 0.25", "leak: -1", 22, "leak of rule 'falls' is -1: need 0.01 to 100"),
        ("samples: 3", "samples: 2.5", 23, "samples of rule 'falls' is 2.5: need a whole number"),
        ("samples: 3", "samples: 0", 23, "samples of rule 'falls' is 0: need 1 to 50"),
        ("action: DEPLOY", "action: FIRE", 24, "need ALARM or FLIGHT_BLOCK or KILL or DEPLOY"),
        ("clears: on_disarm", "clears: ondisarm", 25, "(did you mean on_disarm?)"),
        ("    action: ALARM\n", "", 26, "rule 'silent' has no action: add it"),
        ("    states: IN_FLIGHT\n", "", 26, "rule 'silent' has no states: add it"),
        ("is: LOST}", "is: []}", 28, "is in rule 'silent' is empty: need at least one"),
    ],
)
def test_each_mistake_is_told_with_its_line_and_the_fix(
    old: str, new: str, line: int, words: str
) -> None:
    assert WHOLE.count(old) >= 1
    told = mistakes(WHOLE.replace(old, new, 1))
    at = [one for one in told if one.startswith(f"mine.yaml, line {line}: ")]
    assert any(words in one for one in at), told


def test_a_deploy_without_states_is_told_only_that() -> None:
    told = mistakes(WHOLE.replace("    states: [IN_FLIGHT, KILLING]\n", ""))
    assert told == ["mine.yaml, line 9: rule 'falls' has no states: add it"]


def test_a_rule_without_conditions_is_told_only_that() -> None:
    text = "profile: p\nrules:\n  a:\n    states: READY\n    action: DEPLOY\n    needed: 2\n"
    assert mistakes(text) == ["mine.yaml, line 3: rule 'a' has no conditions: add it"]


def test_every_mistake_is_told_at_once() -> None:
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
def test_what_is_no_profile_at_all_says_so(text: str, words: str) -> None:
    assert any(words in one for one in mistakes(text))


@given(st.text(max_size=200))
def test_no_text_raises_anything_else(text: str) -> None:
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
def test_a_line_that_is_spoilt_is_a_profile_all_the_same_or_a_mistake_with_a_line(
    number: int, instead: str
) -> None:
    text = "\n".join([*LINES[:number], instead, *LINES[number + 1 :]])
    assert wrong(text).startswith(("mine.yaml, line ", "nothing"))


@given(
    st.sampled_from([w for w in WHOLE.replace("\n", " ").split(" ") if w and w[0] not in "{[-"]),
    st.sampled_from([".inf", "-.inf", "1e400", "0x_", "2024-99-99", "~", "!!int x", "=", "<<"]),
)
def test_a_value_that_is_no_value_raises_nothing_else(word: str, value: str) -> None:
    assert wrong(WHOLE.replace(word, value, 1)).startswith(("mine.yaml, line ", "nothing"))


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing", "rocket"])
def test_each_shipped_profile_has_no_mistake_and_says_what_and_wherefrom(name: str) -> None:
    text = (PROFILES / f"{name}.yaml").read_text(encoding="utf-8")
    profile = read(text)
    assert profile.name == name
    for rule in profile.rules:
        assert rule.says
        assert rule.source


def test_no_rule_has_a_persons_name() -> None:
    """What a person orders passes below the minimum height."""
    (told,) = mistakes(WHOLE.replace("  falls:", "  operator:"))
    assert told == (
        "mine.yaml, line 9: rule 'operator' has a person's name, whom no height holds back: "
        "rename it"
    )


@pytest.mark.parametrize("number", ["1" + "0" * 400, "0x" + "f" * 4000])
def test_a_number_that_no_float_holds_is_no_number(number: str) -> None:
    assert any("need a number" in one for one in mistakes(WHOLE.replace("-12.5", number, 1)))


def test_a_key_that_aliases_make_endless_is_not_spelt_out() -> None:
    """Nine times as long with each line: the last one would fill the memory."""
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    for before, name in zip("abcdefghijk", "bcdefghijkl", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]")
    (told,) = [one for one in mistakes("\n".join([*lines, "? *l", ": 1"])) if "no word" in one]
    assert told.startswith("mine.yaml, line 12: a key of a profile is no word")


def test_what_is_in_doubt_counts_in_full_and_all_is_counted_unless_it_says_so() -> None:
    falls = read(WHOLE).rules[0]
    assert falls.doubted == 1.0
    assert all(one.counted for one in falls.conditions)
    text = WHOLE.replace("leak: 0.25", "doubted: 0.25").replace("on_disarm", "never")
    falls = read(text.replace("rebooted}", "lost, counted: false}")).rules[0]
    assert falls.doubted == 0.25
    assert [one.counted for one in falls.conditions] == [True, True, True, False, True]


def test_a_rule_that_would_be_full_at_once_again_is_refused() -> None:
    text = WHOLE.replace("rebooted}", "rebooted, counted: false}")
    assert "with `counted: false` it clears never" in wrong(text)


def test_a_rule_that_counts_nothing_is_refused() -> None:
    silent = "conditions: {link: mavlink_parachute, is: LOST}"
    lost = "conditions: {autopilot: lost, counted: false}"
    assert "rule 'silent' counts nothing" in wrong(WHOLE.replace(silent, lost))
