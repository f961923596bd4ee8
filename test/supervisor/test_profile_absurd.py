"""What a profile says by mistake: a number that YAML reads as another, a limit nobody can mean."""

import pytest
from test_profile_reader import WHOLE, mistakes, read

RULE = "profile: p\nrules:\n  a:\n    states: IN_FLIGHT\n    action: KILL\n    conditions:\n"


def told_of(*conditions: str, **lines: str) -> list[str]:
    """What is said of a profile of one rule with these conditions."""
    text = RULE + "".join(f"      - {{{one}}}\n" for one in conditions)
    return mistakes(text + "".join(f"    {key}: {value}\n" for key, value in lines.items()))


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("010", "8"),
        ("0x10", "16"),
        ("0b101", "5"),
        ("1:30", "90"),
        ("1:30.5", "90.5"),
        ("1_000", "1000"),
        ("0.1_5", "0.15"),
        ("08.5", "8.5"),
    ],
)
def test_a_number_that_yaml_reads_as_another_is_refused(written, meant):
    (told,) = mistakes(WHOLE.replace("minimum_height: 12", f"minimum_height: {written}"))
    assert told == (
        f"mine.yaml, line 2: minimum_height is {written}, which YAML reads as {meant}: "
        f"write {meant}, if that is meant"
    )


@pytest.mark.parametrize("written", [".5e3", "1e3", "5e-1", "08", "0o17"])
def test_a_number_that_yaml_takes_for_text_is_refused_with_the_fix(written):
    (told,) = mistakes(WHOLE.replace("minimum_height: 12", f"minimum_height: {written}"))
    assert told == (
        f"mine.yaml, line 2: minimum_height is {written}, which YAML reads as text: "
        "need a number in plain digits, as 12.5"
    )


@pytest.mark.parametrize("written", ["12", "12.", "+12", "12.0", "1.2e+1"])
def test_a_number_that_all_read_alike_is_that_number(written):
    text = WHOLE.replace("minimum_height: 12", f"minimum_height: {written}")
    assert read(text).minimum_height == 12.0


@pytest.mark.parametrize(("word", "meant"), [("yes", "true"), ("Off", "false"), ("NO", "false")])
def test_a_truth_is_true_or_false_and_no_other_word(word, meant):
    (told,) = told_of(f"measurement: tilt_deg, above: 60, if_unknown: {word}")
    assert told == (
        f"mine.yaml, line 7: if_unknown of tilt_deg in rule 'a' is {word}, which YAML reads as "
        f"{meant}: write {meant}, or '{word}' if it is a word"
    )


def test_a_number_in_a_rule_is_looked_at_as_well():
    (told,) = told_of("measurement: tilt_deg, above: 1:00")
    assert "line 7: above of tilt_deg in rule 'a' is 1:00, which YAML reads as 60" in told
    (told,) = told_of("autopilot: lost", **{"for": "0x1"})
    assert "line 8: for of rule 'a' is 0x1, which YAML reads as 1" in told


def test_a_profile_without_any_rule_is_refused():
    (told,) = mistakes("profile: p\nrules: {}\n")
    assert told == (
        "mine.yaml, line 2: rules is empty: need at least one; "
        "the profile by_hand decides nothing itself"
    )


@pytest.mark.parametrize(
    ("condition", "problem"),
    [
        ("measurement: tilt_deg, above: 181", "can never hold: tilt_deg is 0 to 180.001"),
        ("measurement: tilt_deg, below: 0", "can never hold: tilt_deg is 0 to 180.001"),
        ("measurement: tilt_deg, above: -1", "always holds: tilt_deg is 0 to 180.001"),
        ("measurement: acceleration, above: -3", "always holds: acceleration is 0 to 2000"),
        ("measurement: battery_remaining, below: 5", "always holds: battery_remaining is 0 to 1"),
        ("measurement: climb_rate, below: -500", "can never hold: climb_rate is -400 to 400"),
        ("measurement: height, above: 1.0e+6", "can never hold: height is -500 to 50000"),
        (
            "measurement: acceleration, below: 3, until: 3000",
            "has an until that is never reached: acceleration is 0 to 2000",
        ),
    ],
)
def test_a_limit_beyond_what_can_be_measured_is_refused(condition, problem):
    name = condition.split()[1].rstrip(",")
    assert told_of(condition) == [f"mine.yaml, line 7: {name} in rule 'a' {problem}"]


def test_what_can_be_measured_is_what_the_profile_says():
    text = RULE.replace("rules:", "measurements: {height: {maximum: 90000}}\nrules:")
    assert read(f"{text}      - {{measurement: height, above: 60000}}\n").rules
    assert told_of("measurement: height, above: 60000")


def test_limits_that_cannot_hold_together_are_refused():
    """A tilt over 60 and one under 30 degrees: the rule would be there and never act."""
    both = ("measurement: tilt_deg, above: 60", "measurement: tilt_deg, below: 30")
    (told,) = told_of(*both)
    assert told == (
        "mine.yaml, line 3: rule 'a' can never hold: 1 at most of needed 2 can be true at once"
    )
    alarm = RULE.replace("KILL", "ALARM")
    assert read(alarm + f"      - {{{both[0]}}}\n      - {{{both[1]}}}\n    needed: 1\n").rules


def test_limits_of_which_one_always_holds_are_refused():
    both = ("measurement: tilt_deg, above: 30", "measurement: tilt_deg, below: 60")
    (told,) = told_of(*both, needed="1")
    assert told == "mine.yaml, line 3: rule 'a' always holds: its limits leave no value out"


@pytest.mark.parametrize("action", ["KILL", "DEPLOY"])
def test_what_ends_a_flight_waits_for_a_minute_at_most_and_an_alarm_for_ten(action):
    alarm = RULE.replace("KILL", "ALARM") + "      - {autopilot: rebooted}\n"
    assert read(f"{alarm}    for: 600\n").rules[0].hold == 600.0
    (told,) = mistakes(alarm.replace("ALARM", action) + "    for: 3600\n")
    assert told == "mine.yaml, line 8: for of rule 'a' is 3600: need 0 to 60"


def test_a_counter_that_ends_a_flight_forgets():
    """Without a leak, one second of a whole season would add up to a kill."""
    (told,) = told_of("autopilot: rebooted", leak="0", **{"for": "1"})
    assert told == "mine.yaml, line 8: leak of rule 'a' is 0: need 0.01 to 100"


@pytest.mark.parametrize(
    ("given", "need"),
    [
        ("height: {max_age: 60}", "max_age of height is 60: need 0.1 to 10"),
        ("height: {rate: 1.0e+9}", "rate of height is 1000000000.0: need 20 to 8000"),
        ("tilt_deg: {jump: -2}", "jump of tilt_deg is -2: need 3 to 1200"),
        ("height: {maximum: .inf}", "maximum of height is inf: need -1e+06 to 1e+06"),
        ("height: {stuck_after: 3600}", "stuck_after of height is 3600: need 0 to 600"),
    ],
)
def test_limits_of_a_measurement_that_would_let_anything_pass_are_refused(given, need):
    text = WHOLE.replace("height: {maximum: 9000, jump: 20.0}", given)
    assert mistakes(text) == [f"mine.yaml, line 7: {need}"]


@pytest.mark.parametrize("given", ["minimum_height: 1.0e+6", "low_height: 5000.0"])
def test_a_height_below_which_nothing_would_ever_open_is_refused(given):
    (told,) = mistakes(WHOLE.replace("minimum_height: 12", given))
    assert told.endswith("need 0 to 1000")
