"""The card of a deployment that was tried: what a black box knows, and lines for the rest."""

import hashlib
import math

import pytest
from chute_msgs.msg import PersonRequest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flight_bench import DEPLOY_AT, Flight

from chute_ros.model import LandedState, VehicleState
from chute_ros.tools.descent import descent
from chute_ros.tools.test_card_command import main
from chute_ros.tools.test_card_command import test_card as card_of

pytestmark = pytest.mark.xdist_group("report")


def falls(rate, opens_at=2.0, lands_at=12.0, step=0.1):
    """From 100 m at 0 s: it falls until its canopy carries, 0.5 s later at this rate (m/s)."""
    reports, t, height, sink = [], 0.0, 100.0, 0.0
    while t < lands_at + 2.0:
        landed = t >= lands_at
        sink = 0.0 if landed else sink + 9.8 * step if t < opens_at else max(rate, sink - 3.0)
        height -= sink * step
        reports.append(
            (
                t,
                VehicleState(
                    landed_state=LandedState.ON_GROUND if landed else LandedState.IN_AIR,
                    landed_state_age=0.0,
                    height=height,
                    height_age=0.0,
                    vertical_speed=-sink,
                    vertical_speed_age=0.0,
                ),
            )
        )
        t = round(t + step, 6)
    return reports


def test_the_descent_tells_how_fast_it_came_down_and_when_the_canopy_carried():
    found = descent(falls(5.0), 1.0)
    assert found.fastest == pytest.approx(19.6, abs=0.1)
    assert found.rate == pytest.approx(5.0)
    assert found.carried_after == pytest.approx(1.5, abs=0.11)
    heights = {when: state.height for when, state in falls(5.0)}
    assert found.lost == pytest.approx(heights[1.0] - heights[2.5], abs=1.0)
    assert found.took == pytest.approx(10.9, abs=0.01)


def test_of_a_vehicle_that_said_too_little_nothing_is_known():
    assert all(map(math.isnan, vars(descent(falls(5.0)[:9], 0.0)).values()))
    old = [(when, VehicleState()) for when, _ in falls(5.0)]
    assert all(map(math.isnan, vars(descent(old, 0.0)).values()))


def test_one_that_is_never_carried_has_no_time_at_which_it_was():
    found = descent(falls(5.0, opens_at=100.0, lands_at=4.0), 0.0)
    assert found.fastest == pytest.approx(39.2, abs=0.1)
    # The sink in the end is that of the fall: it shows in the card beside the fastest.
    assert found.rate > 25.0


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    one = Flight(tmp_path_factory.mktemp("flight"))
    values = [KeyValue(key="chute_ros", value="0.1.0"), KeyValue(key="Fast DDS", value="2.14.5")]
    status = DiagnosticStatus(name="drone1/upf_can: middleware", values=values)
    one.box.message("diagnostics", DiagnosticArray(status=[status]))
    one.fly()
    one.land()
    return one


def test_it_has_the_files_the_settings_the_versions_and_the_release(flight):
    text = card_of(flight.files())
    for path in flight.files():
        assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert "profile by_hand" in text
    assert "2.14.5" in text
    assert "drone1/upf_can" in text
    assert f"{DEPLOY_AT:.0f}." in text
    assert "it falls" in text
    assert "names and signatures" in text
    assert "no certificate" in text


def test_nothing_of_a_recording_reaches_it_raw(tmp_path):
    one = Flight(tmp_path)
    one.reason = "<script>alert(1)</script>"
    one.box.message("safety/person", PersonRequest(link="<b>", service="~/deploy"))
    one.fly()
    one.land()
    assert "<script" not in card_of(one.files())


def test_the_command_writes_it_beside_the_file(flight, monkeypatch, capsys):
    (path,) = flight.files()
    monkeypatch.setattr("sys.argv", ["test_card", str(path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    written = path.with_name(f"{path.name}.card.html")
    assert capsys.readouterr().out == f"{written}\n"
    assert written.read_text().startswith("<!DOCTYPE html>")


def test_what_is_no_recording_ends_it_in_a_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "none.mcap").write_bytes(b"nothing")
    monkeypatch.setattr("sys.argv", ["test_card", str(tmp_path / "none.mcap")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("test_card: ")
