"""The parts of a vehicle's page: nothing old as if it were now, no text as HTML. Pure."""

from __future__ import annotations

import datetime
import html
import math
import re

import pytest
from chute_msgs.msg import ActionReport, RuleState, SafetyDecision, SafetyState, Telem
from heard_vehicle import Heard, heartbeat, parachute, stamped, state, vehicle

from chute_ros.supervisor.machine import Stage
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.panel import sections
from chute_ros.tools.panel.rocket import rocket

TODAY = datetime.date(2026, 7, 1)
HOSTILE = "<script>alert(1)</script>&\"'"


def text_of(part):
    """What a person reads of it."""
    return " ".join(html.unescape(re.sub("<[^>]*>", " ", part.replace("<wbr>", ""))).split())


def shown(at=0.0, **fields):
    return Heard().hears(stamped(state(**fields))).view(at)


@pytest.mark.parametrize("stage", Stage)
def test_each_state_is_one_large_word_with_a_reason(stage):
    part = sections.banner(shown(state=int(stage), state_text=stage.name))
    word = re.search('class="word">(.*?)</div>', part)[1]
    assert text_of(word)[2:] == stage.name.replace("_", " ")
    why = re.search('class="why">(.*?)</div>', part)[1]
    assert why == html.escape(sections.MEANINGS[stage.name])


def test_the_supervisors_own_reason_comes_first():
    told = {"state": SafetyState.BLOCKED, "flight_blocked": True, "block_reasons": ["no fuel"]}
    assert "no fuel" in sections.banner(shown(state_text="BLOCKED", **told))
    part = sections.banner(shown(state_text="BLOCKED: lost", **told))
    assert '<div class="why">lost</div>' in part, "the name of the state stands above it"


def test_what_is_old_is_no_state():
    part = text_of(sections.banner(shown(3.0)))
    assert part == "○ NOT KNOWN NOW It was IN_FLIGHT; the last word came 3 s ago."


def test_a_mode_that_does_not_fire_stands_out_and_so_does_an_alarm():
    part = sections.banner(shown(mode=SafetyState.SHADOW, alarms=["the disk is full"]))
    assert "SHADOW: it decides, and sends nothing" in text_of(part)
    assert "the disk is full" in text_of(part)
    assert "INHIBITED: it does nothing" in text_of(
        sections.banner(shown(mode=SafetyState.INHIBITED))
    )


def test_a_vehicle_that_nobody_guards_is_no_calm_flight():
    why = "no parachute can be reached: mavlink_parachute is LOST"
    alarms = ["rule 'link lost' warns: nothing is received from a device", why]
    part = sections.banner(shown(state_text=f"IN_FLIGHT, NOT GUARDED: {why}", alarms=alarms))
    assert "tone-bad" in part
    # Each is told once.
    assert text_of(part) == f"✖ IN FLIGHT, NOT GUARDED {why} {alarms[0]}"
    # What only warns takes the calm colour away.
    part = sections.banner(shown(state_text=f"IN_FLIGHT: {alarms[0]}", alarms=alarms[:1]))
    assert "tone-warn" in part
    assert text_of(part) == f"■ IN FLIGHT {alarms[0]}"


def test_a_parachute_that_is_armed_on_the_ground_colours_every_state():
    for stage in (Stage.READY, Stage.LANDED, Stage.BLOCKED):
        heard = Heard().hears(stamped(state(state=int(stage), state_text=stage.name)))
        assert "tone-live" not in sections.banner(heard.view())
        assert "tone-live" in sections.banner(heard.hears(stamped(parachute())).view())


def test_a_mode_that_sends_nothing_takes_the_calm_colour_away():
    told = {"state": SafetyState.READY, "state_text": "READY"}
    assert "tone-good" in sections.banner(shown(**told))
    assert "tone-warn" in sections.banner(shown(mode=SafetyState.SHADOW, **told))


def test_a_fault_is_a_sentence_with_its_detail_below_it():
    told = {"state": SafetyState.FAULT, "alarms": ["no parachute confirmed within 3 s: denied"]}
    part = sections.banner(shown(state_text="FAULT: nothing came out, ordered by Anna", **told))
    assert '<div class="why">nothing came out, ordered by Anna</div>' in part
    assert part.count("denied") == 1


def test_a_rule_that_only_warns_says_so():
    rule = RuleState(name="link lost", alive=True, fulfilled=True, latched=True)
    assert text_of(sections.rules(shown(rules=[rule]).rules, False)) == "Rules link lost warns"


def parachute_part(at=0.0, identities=None, **fields):
    heard = Heard().hears(stamped(state())).hears(stamped(parachute(**fields)))
    return sections.parachutes(heard.view(at), identities or {}, TODAY)


def test_a_parachute_with_all_that_is_known_of_it():
    part = parachute_part(
        armed_triggers=4 | 8,
        deployed=True,
        deployment_trigger=4,
        packed_date="2026-06-19",
        backup_voltage=8.25,
        faults=["low power"],
        identities={"mavlink_parachute 1/161": "ACME, serial number 7, firmware 1.2"},
    )
    assert text_of(part) == (
        "Parachute mavlink_parachute 1/161 armed ◆ YES: FC, OFFBOARD released ▼ YES, by an "
        "order over MAVLink (MAVLINK) state ◆ ARMED, link OK packed 2026-06-19, 12 days ago own "
        "supply 8.2 V own height 0.0 m "
        "identity ACME, serial number 7, firmware 1.2 fault ✖ low power last word <1 s ago"
    )


def test_a_parachute_that_is_silent_is_grey():
    assert 'class="card"' in parachute_part(1.9)
    part = parachute_part(2.5)
    assert 'class="card old"' in part
    assert "OLD: 2 s ago" in text_of(part)


@pytest.mark.parametrize(
    ("date", "told"),
    [
        ("", "packed not reported"),
        ("2026-07-01", "2026-07-01, 0 days ago"),
        ("2026-07-03", "2026-07-03, in 2 days: one of the two clocks is wrong"),
        ("soon", "packed soon"),
    ],
)
def test_the_day_of_packing_and_its_age(date, told):
    assert told in text_of(parachute_part(packed_date=date))


def test_each_measurement_of_the_vehicle_has_its_age():
    heard = Heard().hears(stamped(state()))
    heard.hears(vehicle(roll=0.1, pitch=0.0, yaw=math.pi, tilt=0.1, attitude_age=5.0))
    part = sections.vehicle(heard.view())
    assert "height 61.2 m <1 s ago" in text_of(part)
    assert '<div class="row old"><span>tilt</span><span>6 ° <small>OLD: 5 s ago' in part
    assert "battery 15.8 V, 87 % 1 s ago" in text_of(part)


def test_what_was_not_received_since_the_page_listens_is_not_told_to_have_never_been():
    """Its supervisor may have lost it a second before."""
    picture = Heard().hears(stamped(state())).view(4.0)
    for part in (sections.vehicle(picture), sections.parachutes(picture, {}, TODAY)):
        assert "not received here within 4 s" in text_of(part)
        assert "never" not in text_of(part)


def test_the_ages_of_a_node_and_of_its_device_are_told_apart():
    heard = Heard().hears(stamped(state(link_states=[3], devices_healthy=[False])))
    heard.hears(stamped(heartbeat(age=7.9)))
    part = text_of(sections.links(heard.view().links, False))
    assert "LOST, device NOT healthy, device OLD: 8 s ago, node <1 s ago" in part


def test_rules_are_bars_that_fill():
    rules = [
        RuleState(name="excess tilt", action=SafetyDecision.DEPLOY, alive=True, hold=0.25),
        RuleState(
            name="free fall",
            action=SafetyDecision.DEPLOY,
            alive=True,
            level=0.25,
            hold=0.5,
            conditions=["[x] acceleration 0.65 (below 2)"],
        ),
        RuleState(name="on the ground alone", action=SafetyDecision.KILL, hold=0.25),
        RuleState(name="autopilot lost", action=SafetyDecision.DEPLOY, conditions=["needs imu"]),
        RuleState(name="battery", action=0, alive=True, fulfilled=True, denied="not armed"),
    ]
    part = sections.rules(shown(rules=rules).rules, False)
    assert re.findall(r'aria-label="(.*?)".*?aria-valuenow="(\d+)"', part) == [
        ("free fall", "50"),
        ("battery", "100"),
        ("excess tilt", "0"),
    ]
    assert "not acted on: not armed" in part
    assert "[x] acceleration 0.65 (below 2)" in part
    assert "not active now ○ on the ground alone autopilot lost ○ needs imu" in text_of(part)


def test_decisions_the_newest_first_with_what_came_of_them():
    heard = Heard().hears(stamped(state()))
    for number, action in ((1, SafetyDecision.KILL), (2, SafetyDecision.DEPLOY)):
        one = SafetyDecision(epoch=7, id=number, action=action, rule="free fall", reasons=["fast"])
        heard.hears(stamped(one))
    heard.hears(
        ActionReport(epoch=7, id=2, link="mavlink_parachute", action=4, outcome=1, detail="sent")
    )
    part = text_of(sections.decisions(heard.view().decisions))
    assert part.index("DEPLOY by rule 'free fall'") < part.index("KILL by rule 'free fall'")
    assert "→ mavlink_parachute SENT: sent" in part


def test_flight_blocks_do_not_push_out_the_newest_kill():
    heard = Heard().hears(stamped(state()))
    heard.hears(stamped(SafetyDecision(epoch=7, id=1, action=3, rule="falling", reasons=["why"])))
    for number in range(2, 12):
        heard.hears(stamped(SafetyDecision(epoch=7, id=number, action=1, rule="links")))
    part = text_of(sections.decisions(heard.view().decisions))
    assert part.endswith("KILL by rule 'falling', 0 s ago why")


def test_diagnostics_tell_what_is_not_ok():
    tasks = [
        Task("drone/upf_can: controller 33", "ERROR", "no power", {}, 0.1),
        Task("drone/upf_can: link", "OK", "open", {}, 0.1),
    ]
    assert text_of(sections.diagnostics(tasks)) == (
        "Diagnostics ERROR upf_can: controller 33 ✖ no power 1 of 2 OK"
    )


def test_what_a_silent_supervisor_said_is_grey_everywhere():
    heard = Heard().hears(stamped(state(rules=[RuleState(name="free fall", alive=True)])))
    picture = heard.view(3.0)
    for part in (sections.links(picture.links, True), sections.rules(picture.rules, True)):
        assert 'class="card old"' in part
        assert "is-good" not in part
    tasks = [Task("drone/safety_supervisor: decisions", "OK", "READY", {}, 6.0)]
    assert text_of(sections.diagnostics(tasks)) == (
        "Diagnostics safety_supervisor: decisions ○ not received now; OLD: 6 s ago 0 of 1 OK"
    )


def test_a_mode_without_a_name_is_not_explained():
    part = text_of(sections.banner(shown(mode=77)))
    assert "number 77: what it does is not known" in part


def test_before_the_first_word_it_says_what_it_looks_for():
    assert "No supervisor is received in /drone1 for 12 s. Looked for in: ROS domain 3." in (
        text_of(sections.nothing("/drone1", "ROS domain 3", 12.0))
    )


def test_no_text_from_the_network_becomes_a_part_of_the_page():
    rule = RuleState(name=HOSTILE, alive=True, level=1.0, hold=1.0, conditions=[HOSTILE])
    hostile = state(
        supervisor=HOSTILE,
        state_text=HOSTILE,
        block_reasons=[HOSTILE],
        device_blocks=[HOSTILE],
        alarms=[HOSTILE],
        unusable=[HOSTILE],
        links=[HOSTILE],
        decision_id=1,
        decision_rule=HOSTILE,
        rules=[rule],
    )
    heard = Heard().hears(stamped(hostile))
    heard.hears(stamped(parachute(link=HOSTILE, device=HOSTILE, packed_date=HOSTILE)))
    heard.hears(vehicle(source=HOSTILE, faults=[HOSTILE]))
    heard.hears(stamped(SafetyDecision(epoch=7, id=1, rule=HOSTILE, reasons=[HOSTILE])))
    picture = heard.view()
    telem = Telem(layout=HOSTILE)
    task = Task(f"a/{HOSTILE}: {HOSTILE}", "WARN", HOSTILE, {}, 0.0)
    page = "".join(
        (
            sections.banner(picture),
            sections.blocks(picture),
            sections.parachutes(picture, {f"{HOSTILE} {HOSTILE}": HOSTILE}, TODAY),
            sections.links(picture.links, False),
            sections.vehicle(picture),
            sections.rules(picture.rules, False),
            sections.decisions(picture.decisions),
            sections.diagnostics([task]),
            sections.nothing(HOSTILE, HOSTILE, 1.0),
            rocket(telem, 0.0, [task]),
        )
    )
    assert page.count("&lt;script&gt;") >= 20
    assert "<script" not in page
    assert "\"'" not in html.unescape(re.sub(">[^<]*<", "><", page)).replace("&\"'", "")


def test_a_rocket_with_its_valves_and_its_memory():
    telem = Telem(
        layout="telem57",
        flight_mode=Telem.COAST,
        altitude=812.4,
        predicted_apogee=1500.0,
        sv_open=1,
        mav_open=0,
        ssa_drogue_deployed=1,
        ssa_main_deployed=-1,
        airbrake_state=1,
        airbrake_deployment=0.25,
        num_satellites=9,
        blims_dist_to_target=320.0,
        blims_bearing_deg=45.0,
    )
    memory = Task("rocket/umbilical: memory", "OK", "no dump", {"newest progress": "done"}, 0.1)
    assert text_of(rocket(telem, 0.2, [memory])) == (
        "Rocket key ARMED flight mode COAST altitude 812.4 m predicted apogee 1500.0 m solenoid "
        "valve OPEN main valve closed drogue DEPLOYED main parachute not reported air brake "
        "deployed, 25 % open "
        "satellites 9 BLiMS target 320 m at 45 ° telemetry telem57, <1 s ago "
        "memory no dump (done), <1 s ago"
    )
    assert 'class="card old"' in rocket(telem, 3.0, [])


def test_what_a_rocket_does_not_tell_is_not_told():
    nothing = Telem(
        flight_mode=255,
        altitude=math.nan,
        predicted_apogee=math.nan,
        sv_open=-1,
        mav_open=-1,
        ssa_drogue_deployed=-1,
        ssa_main_deployed=-1,
        airbrake_state=-1,
        num_satellites=-1,
        blims_dist_to_target=math.nan,
    )
    part = text_of(rocket(nothing, math.nan, []))
    assert part.count("not reported") == 8
    assert part.count("not known") == 2
    assert "never received" in part


@pytest.mark.parametrize(
    ("mode", "told"),
    [
        (Telem.STARTUP, "key not armed"),
        (Telem.STANDBY, "key ARMED"),
        (Telem.COAST, "key ARMED"),
        (Telem.FAULT, "key not reported"),
        (255, "key not reported"),
    ],
)
def test_of_the_key_is_said_what_the_mode_tells(mode, told):
    assert told in text_of(rocket(Telem(flight_mode=mode), 0.1, []))


def test_a_wipe_is_a_bar_that_fills_and_a_dump_one_that_moves():
    values = {"newest progress": "wiping the flash: 3 of 4 sectors", "newest progress (%)": "75"}
    wipe = Task("rocket/umbilical: memory", "WARN", "wipe flash is in progress", values, 0.1)
    part = rocket(Telem(), 0.1, [wipe])
    assert 'aria-valuenow="75"' in part
    assert 'style="width:75%"' in part
    values = {"newest progress": "dump flash: 262144 bytes", "newest progress (%)": ""}
    dump = Task("rocket/umbilical: memory", "WARN", "dump flash is in progress", values, 0.1)
    part = rocket(Telem(), 0.1, [dump])
    assert '<i class="unknown">' in part
    assert "aria-valuenow" not in part


def test_a_long_name_is_broken_where_a_word_of_it_ends():
    assert sections.broken("mavlink_parachute 1/161") == "mavlink_<wbr>parachute 1/<wbr>161"
    assert sections.broken("<b>") == "&lt;b&gt;"
