"""Orders with their rule and reasons: what mutants showed that no story looked at."""

import pytest
from story import SINKS, Story, rule, with_rules

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i

K, D = Action.KILL, Action.DEPLOY
DEPLOYS, KILLS = rule(SINKS), rule(SINKS, action=K)


def test_in_shadow_a_kill_and_a_deploy_are_said_with_their_rule_and_reasons() -> None:
    story = Story(with_rules(DEPLOYS), mode=i.Mode.SHADOW).flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    story.at(0.2, i.DeployRequest(6, False, "it falls"))
    said = [(d.action, d.rule, d.reasons) for d in story.decisions() if d.action >= K]
    assert said == [
        (K, "operator", ("operator: stop",)),
        (K, "operator", ("operator: it falls",)),
        (D, "operator", ("operator: it falls",)),
    ]
    assert all(d.shadow for d in story.decisions())


@pytest.mark.parametrize("wanted", [KILLS, DEPLOYS])
def test_the_log_says_what_a_rule_saw(wanted: object) -> None:
    story = Story(with_rules(wanted)).flying()
    story.at(0.1, story.told(vertical_speed=-13.0))
    reasons = story.newest(K).reasons
    assert f"IN_FLIGHT -> KILLING: a kill was decided ({'; '.join(reasons)})" in story.said()


def test_the_log_says_what_a_person_wanted() -> None:
    story = Story().flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    assert "IN_FLIGHT -> KILLING: a kill was decided (operator: stop)" in story.said()
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert story.answer(5).success
