"""The soak says what must not be: stories of loops, and lines through what processes hold."""

import pytest

from faults.soak_judge import ANSWER_WITHIN, Happened, judge
from faults.soak_measure import ENOUGH, LIMITS, growth, slope
from faults.soak_plan import KINDS, MOTOR, NODES, draw
from faults.soak_relay import DEPLOY, KILL


def quiet(**more):
    """A fault from 1 to 2 s, whole at 3 s."""
    return Happened(**{"fault_at": 1.0, "fault_over": 2.0, "whole_at": 3.0, **more})


def answered(**more):
    """The same; at 1.5 s a motor fails, and what must follow follows."""
    return quiet(
        **{
            "cause_at": 1.5,
            "decided": [(2.0, KILL), (2.1, DEPLOY)],
            "orders": [(2.01, KILL), (2.11, DEPLOY)],
            "killed": [2.02],
            "released": [(2.2, "parachute")],
            **more,
        }
    )


@pytest.mark.parametrize("seen", [quiet(), answered(), answered(whole_at=float("nan"))])
def test_what_is_as_it_must_be_is_no_finding(seen):
    assert judge(seen) == []


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (quiet(orders=[(1.2, KILL)]), "KILL on the wire without a cause"),
        (quiet(released=[(1.2, "upf")]), "upf came out without a cause"),
        (answered(orders=[(1.2, KILL), (2.11, DEPLOY)]), "KILL on the wire without a cause"),
        (answered(released=[]), "the parachute did not come out within 12 s"),
        (answered(killed=[]), "the autopilot was told of no kill"),
        (answered(decided=[(2.0, DEPLOY), (2.1, KILL)]), "a deploy was decided before the kill"),
        (
            answered(released=[(2.2, "parachute"), (2.9, "parachute")]),
            "parachute was released 2 times",
        ),
        (
            quiet(whole_at=float("nan"), complaints=["x is LOST"]),
            "not whole within 20 s: x is LOST",
        ),
        (quiet(ended_as_meant=False, state_text="LANDED"), "the vehicle is LANDED"),
        (quiet(troubles=["upf_can ended by itself with code 1"]), "upf_can ended by itself"),
    ],
)
def test_what_must_not_be_is_said(seen, said):
    (finding,) = judge(seen)
    assert finding.startswith(said)


def test_a_deploy_on_the_wire_before_any_kill_is_said():
    seen = answered(orders=[(1.9, DEPLOY), (2.01, KILL)], released=[(1.95, "parachute")])
    assert "a deploy was on the wire before the kill" in judge(seen)


def test_a_kill_whose_wire_is_cut_may_come_after_the_deploy_on_another_wire():
    """Given a kill that was decided first, and a MAVLink network that is back only after the UPF
    has fired: nothing is wrong."""
    seen = answered(orders=[(2.11, DEPLOY), (3.5, KILL)], killed=[3.51], fault_over=3.4)
    assert judge(seen) == []


def test_the_time_for_the_answer_begins_with_the_end_of_the_fault():
    late = 2.0 + ANSWER_WITHIN - 0.1
    assert judge(answered(released=[(late, "parachute")])) == []
    assert judge(answered(released=[(late + 0.2, "parachute")]))


def test_one_peak_does_not_move_the_line_and_a_steady_leak_does():
    flat = [(float(n), 80.0) for n in range(40)]
    flat[20] = (20.0, 500.0)
    assert slope(flat) == 0.0
    leaking = [(float(n), 80.0 + 0.5 * n) for n in range(40)]
    assert slope(leaking) == pytest.approx(0.5)


def test_what_leaks_in_each_loop_is_too_much_and_what_settles_is_not():
    leaking = growth([(float(n), 80.0 + 0.5 * n) for n in range(60)])
    settling = growth([(float(n), 85.0 - 5.0 * 0.7**n) for n in range(60)])
    assert leaking.too_much(LIMITS["memory"])
    assert not settling.too_much(LIMITS["memory"])


def test_a_slow_leak_needs_a_long_life_to_be_told_from_what_settles():
    def leak(samples):
        return growth([(float(n), 80.0 + 0.06 * n) for n in range(samples)])

    assert not leak(40).too_much(LIMITS["memory"])
    assert leak(45).too_much(LIMITS["memory"])


def test_too_few_samples_say_nothing():
    assert growth([(float(n), float(n)) for n in range(ENOUGH)]) is None


def test_a_loop_is_the_same_whenever_it_is_drawn_with_its_seed():
    assert draw(7, 40, 2) == draw(7, 40, 2)
    assert draw(7, 40, 2) != draw(8, 40, 2)


def test_every_kind_has_its_turn_and_one_supervisor_is_never_asked_for_a_second():
    plans = [draw(1, number, 1) for number in range(600)]
    assert {plan.kind for plan in plans} == set(KINDS)
    assert {plan.kind for plan in plans if plan.cause} == set(KINDS)
    assert MOTOR in {plan.cause for plan in plans}
    assert "second" not in {plan.target for plan in plans}
    killed = {plan.target for plan in plans if plan.kind == "kill -9"}
    assert killed >= {*NODES, "first"}


def test_where_supervisors_are_spared_all_else_is_killed():
    plans = [draw(1, number, 2, spared=True) for number in range(600)]
    killed = {plan.target for plan in plans if plan.kind == "kill -9"}
    assert killed >= set(NODES)
    ended = killed | {plan.beside for plan in plans}
    assert not ended & {"first", "second"}
    assert "first" in {draw(1, number, 2).beside for number in range(600)}


def test_only_the_kinds_that_are_asked_for_are_drawn():
    assert {draw(1, number, 2, ("disk",)).kind for number in range(20)} == {"disk full"}


def test_a_machine_that_stood_still_is_named_beside_what_was_late_and_is_no_finding_by_itself():
    assert judge(quiet(held_up=3.0)) == []
    late = judge(quiet(whole_at=float("nan"), held_up=3.0))
    assert late[-1] == "(the machine held everything up for 3.0 s at a time)"
