"""Why a flight computer is not healthy: the whole reason, with its value and what is needed."""

from umbilical_link_bench import FAULT, STANDBY, Bench

from chute_ros.links.umbilical.runtime import reasons_of


def reasons(story):
    link = story.link
    status = link.computer.status(story.now, link.pause)
    return reasons_of(status, link.received_bytes, link.config.telemetry.stale_after)


def test_nothing_is_wrong_with_a_healthy_one():
    assert reasons(Bench().talk(flight_mode=STANDBY).at(2.0)) == ()


def test_never_heard():
    assert reasons(Bench().at(2.0)) == (
        "the flight computer was never received: 0 bytes received, no $TELEM record, need one",
    )


def test_old_telemetry_is_told_with_its_age_and_the_limit():
    story = Bench().talk(flight_mode=STANDBY).at(2.0).silent().at(6.0)
    first, state = reasons(story)
    assert first.startswith("telemetry STALE: 4.")
    assert first.endswith(" s old, need younger than 3 s")
    assert state == "flight computer: state ABNORMAL, need READY or ARMED"


def test_a_fault_and_a_parachute_that_is_out():
    assert reasons(Bench().talk(flight_mode=FAULT).at(2.0)) == (
        "flight mode Fault",
        "flight computer: state ABNORMAL, need READY or ARMED",
    )
    out = Bench().talk(flight_mode=STANDBY, ssa_drogue_deployed=1).at(2.0)
    assert reasons(out) == (
        "flight computer: state LAUNCHED, the parachute is out, need READY or ARMED",
    )
