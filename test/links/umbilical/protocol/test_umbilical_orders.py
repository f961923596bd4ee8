"""Orders on their way: what is told of them, and what ends them."""

import pytest
from umbilical_link_bench import ASCENT, STANDBY, STARTUP, ready

from chute_ros.links.umbilical.protocol.config import EffectLimits
from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits


def test_an_effect_that_does_not_show_is_ordered_again_until_the_time_is_up():
    bench = ready()
    number = bench.order("open_mav")
    bench.after(9.0)
    assert bench.times("<M>") == [1.05, 2.55, 4.05, 5.55]
    assert bench.end(number).message == (
        "open_mav given up after 5.0 s: sent 4 times, but the device's own status never showed "
        "that telemetry reports mav_open 1"
    )


def test_nothing_is_sent_again_once_the_effect_shows():
    bench = ready()
    number = bench.order("open_mav")
    bench.after(2.0).talk(mav_open=1).after(0.2)
    assert bench.end(number).message == "telemetry reports mav_open 1 after 2.05 s; sent 2 times"
    assert bench.after(9.0).times("<M>") == [1.05, 2.55]
    # The time limits are settings.
    bench = ready(effect=EffectLimits(0.5, 0.25, 1.2))
    number = bench.order("open_mav")
    bench.after(3.0)
    assert bench.times("<M>") == [1.05, 1.55, 2.05]
    assert "given up after 1.2 s" in bench.end(number).message


def test_what_telemetry_said_before_the_order_does_not_confirm_it():
    bench = ready(mav_open=1)
    number = bench.order("open_mav")
    assert bench.tokens == ["<M>"]
    assert bench.after(0.25).ends(number) == [], "it showed before the receiver could take it"
    assert bench.after(0.1).end(number).success


def test_what_telemetry_says_while_it_waits_for_its_turn_does_not_confirm_it():
    bench = ready(mav_open=1, scheduler=SchedulerLimits(0.3, 1.0, 0.5))
    bench.order("flash_info")
    number = bench.order("open_mav")
    assert bench.after(0.5).ends(number) == []
    assert bench.after(0.3).end(number).sent


def test_an_answer_while_it_waits_for_its_turn_does_not_show_what_telemetry_said_before():
    bench = ready(mav_open=1, scheduler=SchedulerLimits(0.3, 1.0, 0.5))
    bench.order("reset_fram")
    number = bench.order("open_mav")
    bench.after(0.25).silent().after(0.06)
    assert bench.tokens == ["<F>", "<M>"]
    bench.hear("Flash: 1/2 KB used (50.0%)")
    assert bench.ends(number) == []


def test_each_request_ends_once_though_many_wait():
    bench = ready(always_alive=True)
    numbers = [bench.order("reset_fram") for _ in range(30)]
    bench.after(6.0)
    assert [bench.end(number).sent for number in numbers] == [True] * 30


def test_a_full_queue_is_told():
    bench = ready(scheduler=SchedulerLimits(most_waiting=2))
    numbers = [bench.order("reset_fram") for _ in range(4)]
    assert bench.end(numbers[3]).message == "reset_fram not sent: 2 commands are waiting already"
    assert not bench.end(numbers[3]).sent
    assert len(bench.after(2.0).tokens) == 3


def test_a_turn_that_does_not_come_in_time_is_told_and_nothing_leaves_after():
    bench = ready(effect=EffectLimits(1.5, 0.25, 1.0), scheduler=SchedulerLimits(0.5, 1.0, 0.5))
    numbers = [bench.order("reset_fram") for _ in range(4)]
    bench.after(5.0)
    assert bench.tokens == ["<F>", "<F>"]
    for number in numbers[2:]:
        assert not bench.end(number).sent
        assert "never sent: its turn did not come" in bench.end(number).message


def test_a_limit_that_is_seen_late_is_no_leave_to_send_what_is_out_of_time():
    bench = ready()
    bench.order("flash_info")
    number = bench.order("open_sv")
    bench.silent()
    bench.t += 30.0
    bench._woken()
    assert bench.tokens == ["<I>"]
    assert not bench.end(number).sent


NEWER = [
    *(("open_mav", "close_mav"), ("close_mav", "open_mav"), ("open_sv", "close_sv")),
    *(("close_sv", "open_sv"), ("key_arm", "key_disarm"), ("key_disarm", "key_arm")),
    *(("open_mav", "safe"), ("open_sv", "safe"), ("launch", "safe"), ("launch", "close_mav")),
    *(("launch", "key_disarm"), ("close_mav", "launch")),
]


@pytest.mark.parametrize(("older", "newer"), NEWER)
def test_the_newer_of_two_that_contradict_counts(older, newer):
    # Telemetry shows the effect of neither.
    mode = STARTUP if older == "key_arm" else STANDBY
    bench = ready(mode, mav_open=int(older == "close_mav"), sv_open=int(older == "close_sv"))
    first = bench.order(older, force=True)
    second = bench.after(0.05).order(newer, force=True)
    assert bench.after(0.01).end(first).message == (
        f"{older} given up: {newer} was ordered; it had been sent once"
    )
    assert bench.ends(second) == []
    bench.after(9.0)
    assert bench.tokens.count(bench.tokens[0]) == 1  # it is not sent again
    assert len(bench.ends(second)) == 1
    # What gave way before it left does not leave: the slot may be free, and nobody has looked.
    for pause in (0.0, 0.05, 0.12):
        bench = ready()
        bench.order("payload_n1")
        first = bench.order(older, force=True)
        bench.t += pause
        bench.order(newer, force=True)
        assert not bench.end(first).sent, pause
        assert len(bench.after(0.5).tokens) == 2, pause


def test_a_target_that_was_set_anew_is_not_set_back():
    bench = ready()
    first = bench.target(1.0, 2.0)
    bench.after(0.2).target(3.0, 4.0)
    assert bench.end(first).message == (
        "set_target given up: set_target was ordered; it had been sent once"
    )
    assert set(bench.after(9.0).tokens[1:]) == {"<T,3.0000000,4.0000000>"}


def test_what_is_not_allowed_any_more_when_its_turn_comes_does_not_leave():
    for names in (("open_mav", "reboot"), *([name] for name in LONG)):
        bench = ready(scheduler=SchedulerLimits(0.5, 1.0, 0.5))
        bench.order("flash_info")
        numbers = [bench.order(name) for name in names]
        forced = bench.order("open_sv", force=True)
        bench.talk(flight_mode=ASCENT).after(2.0)
        assert bench.tokens == ["<I>", "<S>", "<S>"], names
        for number in numbers:
            assert "flight mode Ascent" in bench.end(number).message
            assert not bench.end(number).sent
        assert bench.ends(forced) == []


def test_what_is_not_allowed_any_more_is_not_sent_again():
    """A MAV that is closed in Ascent stops the motor, though the order was given on the pad."""
    for name in ("close_mav", "open_mav", "open_sv", "key_disarm"):
        bench = ready(mav_open=int(name == "close_mav"))
        number = bench.order(name)
        bench.after(0.5).talk(flight_mode=ASCENT).after(9.0)
        assert len(bench.tokens) == 1
        end = bench.end(number)
        why = "not to be sent again (flight mode Ascent); it had been sent once"
        assert end.message == f"{name} given up: {why}"
        assert (end.success, end.sent) == (False, True)


def test_an_effect_that_shows_together_with_another_mode_counts():
    bench = ready()
    number = bench.order("open_mav")
    bench.talk(flight_mode=ASCENT, mav_open=1).after(0.2)
    assert bench.end(number).success


def test_arming_that_the_flight_computer_blocks_ends_with_its_words():
    bench = ready(STARTUP)
    number = bench.order("key_arm")
    bench.after(0.2).hear("Arming blocked: wipe flash first")
    assert bench.end(number).message == (
        "key_arm given up: the flight computer reports: Arming blocked: wipe flash first; "
        "it had been sent once"
    )
    assert bench.after(9.0).tokens == ["<KA>"]


def test_the_key_is_turned_by_arm():
    bench = ready(STARTUP)
    bench.link.arm(1, True, 0, bench.now)
    bench.after(0.2).talk(flight_mode=STANDBY).after(0.2)
    assert bench.end(1).success
    bench.link.arm(2, False, 4, bench.now)
    bench.after(0.2).talk(flight_mode=STARTUP).after(0.2)
    assert bench.end(2).success
    assert bench.tokens == ["<KA>", "<KD>"]


def test_arming_single_triggers_is_refused():
    bench = ready(STARTUP)
    bench.link.arm(1, True, 3, bench.now)
    assert bench.collect().end(1).message == (
        "triggers 3: the key has but one, need 0; nothing was sent"
    )
    assert bench.after(1.0).tokens == []


def test_without_a_port_what_is_not_urgent_is_refused():
    for name in ("open_mav", "launch", "reboot", "flash_info", "wipe_flash"):
        bench = ready().pull()
        number = bench.order(name, force=True)
        text = f"{name} refused: the port is not open; nothing was sent"
        assert bench.end(number).message == text
        assert bench.plug().after(2.0).tokens == []


def test_what_waits_when_the_cable_is_pulled_ends_and_does_not_leave_later():
    for name in ("open_mav", "launch", "reboot", "wipe_flash", "dump_fram"):
        bench = ready()
        bench.order("payload_n1")
        number = bench.order(name, force=True)
        bench.pull()
        end = bench.end(number)
        assert "the cable was pulled" in end.message, name
        assert not end.sent
        bench.after(0.5).plug().after(9.0)
        assert bench.tokens == ["<1>"], name
    bench = ready()
    number = bench.order("open_mav")
    bench.after(0.05).pull()
    assert (bench.end(number).success, bench.end(number).sent) == (False, True)
    assert bench.plug().after(9.0).tokens == ["<M>"]


def test_safe_waits_for_the_cable():
    bench = ready(mav_open=1).pull().after(1.0)
    number = bench.order("safe")
    bench.after(2.0).plug().talk(mav_open=0).after(1.0)
    assert bench.end(number).success
    assert bench.tokens == ["<V>"]


LONG = ("wipe_flash", "dump_flash", "dump_fram", "wipe_fram_and_reboot")


def test_nothing_disturbs_a_launch_that_is_under_way_nor_is_it_ordered_twice():
    for name in ("launch", "reboot", "reset_fram", *LONG):
        bench = ready(STANDBY)
        bench.order("launch", True)
        number = bench.order(name, True)
        assert f"{name} refused: a launch is under way" in bench.end(number).message
        assert bench.after(4.0).tokens == ["<L>"]


def test_nothing_launches_during_a_long_work():
    for name in LONG[:3]:
        bench = ready(STANDBY)
        bench.order(name)
        number = bench.after(0.5).order("launch", True)
        assert "is under way; nothing was sent" in bench.end(number).message, name
        assert "<L>" not in bench.after(4.0).tokens
