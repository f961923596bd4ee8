"""The same settings decide the same; others differ, and it is shown where."""

import os
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import pytest
from flight_bench import DEPLOY_AT, END, STEP, Flight, run

from chute_ros.model import Action
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.record import CODEC
from chute_ros.tools import replay_command as replay
from chute_ros.tools.recording import read
from chute_ros.tools.replaying import Other, Replayer, rows

pytestmark = pytest.mark.xdist_group("replay")
YAML = """\
/**/safety_supervisor:
  ros__parameters:
    profile: by_hand
    {}
"""


@pytest.fixture
def other(tmp_path):
    """A parameter file with these lines."""

    def write(*lines):
        path = tmp_path / "other.yaml"
        path.write_text(YAML.format("\n    ".join(lines)))
        return path

    return write


def test_the_same_settings_give_the_same_decisions(flight, monkeypatch, capsys):
    assert {Action.KILL, Action.DEPLOY} <= set(flight.decided())
    assert run(replay.main, monkeypatch, flight.folder) == 0
    out = capsys.readouterr().out
    assert f"{round(END / STEP)} turns replayed" in out
    assert "0 different" in out
    assert re.search(rf"{DEPLOY_AT:.3f} s  KILL, decision \d+ of epoch 7, by 'operator'", out)
    assert list(flight.folder.glob("*.svg")) == [], "nothing to show"


def test_the_state_is_the_same_after_every_turn_to_the_last_bit(flight):
    core = Replayer()
    for turn in read(flight.files(), {}).turns:
        assert core.step(turn) == turn.turn.outputs
    assert CODEC.to_json(core.state, whole=True) == CODEC.to_json(flight.state, whole=True)


def test_a_recording_that_was_tampered_with_differs(flight, monkeypatch, capsys):
    def tampered(files, kinds):
        recording = read(files, kinds)
        for number, one in enumerate(recording.turns):
            kept = tuple(o for o in one.turn.outputs if not isinstance(o, i.Decide))
            if one.turn.outputs != kept:
                turn = replace(one.turn, outputs=kept)
                recording.turns[number] = replace(one, turn=turn)
        return recording

    monkeypatch.setattr(replay, "read", tampered)
    assert run(replay.main, monkeypatch, *flight.files()) == 1
    out = capsys.readouterr().out
    assert "recorded: nothing" in out
    assert "replayed: DEPLOY" in out


def test_a_bit_of_the_state_that_differs_is_found(flight):
    recording = read(flight.files(), {})
    turns = recording.turns
    core = Replayer()
    middle = len(turns) // 2
    for turn in turns[:middle]:
        core.step(turn)
    strange = replace(core.state, started_at=core.state.started_at + 1e-9)
    core.step(replace(turns[middle], state=strange, config=flight.config))
    assert core.strayed == [turns[middle].wall]


def test_other_settings_show_what_would_have_differed(flight, other, monkeypatch, capsys):
    config, picture = other("kill_to_deploy_delay: 0.0"), flight.folder / "picture.svg"
    arguments = (*flight.files(), "--config", config, "--picture", picture)
    assert run(replay.main, monkeypatch, *arguments) == 1
    out = capsys.readouterr().out
    assert "kill_to_deploy_delay: 0.5 -> 0.0" in out
    earlier = f"{DEPLOY_AT:.3f} s  DIFFERENT"
    assert earlier in out, "the deploy leaves together with the kill"
    told = out[out.index(earlier) :]
    assert told.index("recorded: nothing") < told.index("replayed: DEPLOY")
    root = ElementTree.parse(picture).getroot()
    text = " ".join(root.itertext())
    assert "state, recorded" in text
    assert "state, replayed" in text
    assert "vertical speed" in text
    picture.unlink()


def test_the_picture_goes_beside_the_recording_by_default(flight, other, monkeypatch):
    run(replay.main, monkeypatch, *flight.files(), "--config", other("kill_to_deploy_delay: 0.0"))
    picture = flight.files()[0].with_name(f"{flight.files()[0].name}.replay.svg")
    assert picture.is_file()
    picture.unlink()


def test_the_same_settings_from_a_file_are_no_difference(flight, other, monkeypatch, capsys):
    assert run(replay.main, monkeypatch, *flight.files(), "--config", other("mode: ACTIVE")) == 0
    assert "the same decisions" in capsys.readouterr().out


def test_another_mode_at_the_start_shows_what_would_not_have_been_sent(
    flight, other, monkeypatch, capsys
):
    assert run(replay.main, monkeypatch, *flight.files(), "--config", other("mode: SHADOW")) == 1
    out = capsys.readouterr().out
    assert "mode at the start: SHADOW" in out
    assert "KILL (SHADOW)" in out


def test_answers_of_devices_go_to_the_decision_that_they_were_about(flight):
    """The recorded answers name numbers that the other run gave to other decisions."""
    recording = read(flight.files(), {})
    first = recording.turns[0]
    moved = replace(first, state=replace(first.state, next_id=first.state.next_id + 100))
    core = Replayer(Other(flight.config))
    found = []
    for turn in (moved, *recording.turns[1:]):
        found += rows(turn, core.step(turn), exact=False)
    assert found
    assert all(row.same for row in found), (
        "the kill is confirmed as it was, so all goes on as it did"
    )


def test_rotated_files_replay_in_one_go_and_each_alone(tmp_path, monkeypatch, capsys, await_until):
    flight = Flight(tmp_path, limit=1000)
    for leg in (1, 2, 3):
        flight.fly(3.0 * leg)
        await_until(lambda leg=leg: _is_full(flight, leg), f"file {leg} is full")
    flight.land()
    files = flight.files()
    assert len(files) == 3
    assert run(replay.main, monkeypatch, flight.folder) == 0
    assert f"{round(9.0 / STEP)} turns replayed" in capsys.readouterr().out
    for file in files:
        assert run(replay.main, monkeypatch, file) == 0


def _is_full(flight, number):
    counts = flight.box.counts()
    return f"_{number:06d}_" in counts["file"] and counts["bytes in the file"] > 1000


def test_turns_without_a_beginning_are_counted_not_guessed(flight, monkeypatch, capsys):
    def beheaded(files, kinds):
        recording = read(files, kinds)
        turns = recording.turns
        for number in range(20, 30):
            turns[number] = replace(turns[number], number=turns[number].number + 1000)
        state, core = None, Replayer()
        for turn in turns[:60]:
            core.step(turn)
            state = core.state or state
        turns[60] = replace(turns[60], state=flight.state, config=flight.config)
        return recording

    monkeypatch.setattr(replay, "read", beheaded)
    run(replay.main, monkeypatch, *flight.files())
    assert "40 turns could not be replayed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["takeof_height: 3.0"], "no parameter takeof_height: did you mean takeoff_height?"),
        (["takeoff_height: 3"], "takeoff_height of safety_supervisor is 3: need a number"),
        (["takeoff_height: 1000.0"], "need a number (1.0, not 1) from 0.1 to 100"),
        (["required_links: [1]"], "required_links of safety_supervisor is [1]"),
        (["mode: LOUD"], "need one of ACTIVE, SHADOW, INHIBITED"),
        (["required_links: []"], "need at least one link"),
        (
            ["takeoff_height: 1:30.5"],
            "takeoff_height is 1:30.5, which YAML reads as 90.5: write 90.5",
        ),
        (["ladder: yes"], "ladder is yes, which YAML reads as true: write true, or 'yes' if"),
    ],
)
def test_a_mistake_in_the_settings_is_told_in_one_line(
    lines, told, flight, other, monkeypatch, capsys
):
    assert run(replay.main, monkeypatch, *flight.files(), "--config", other(*lines)) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a: [", "cannot be read"),
        ("/**/upf_can:\n  ros__parameters: {}\n", "has no ros__parameters for"),
        ("- 1\n", "has no ros__parameters for"),
        ("ros__parameters: {mode: SHADOW}\n", "has no ros__parameters for"),
        pytest.param("[" * 3000, "cannot be read", id="deep"),
        ("a: 2001-12-14t21:59:43.10-99:99", "cannot be read"),
        ("a: &a {b: *a}", "more than 1000 names in it: no parameter file"),
    ],
)
def test_a_file_without_settings_is_told(text, told, flight, tmp_path, monkeypatch, capsys):
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    assert run(replay.main, monkeypatch, *flight.files(), "--config", path) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("key", ["/**", "/drone1/safety_supervisor", "/*/safety_supervisor"])
def test_settings_are_found_under_every_name_of_the_node(
    key, flight, tmp_path, monkeypatch, capsys
):
    path = tmp_path / "named.yaml"
    path.write_text(f"{key}:\n  ros__parameters:\n    takeoff_height: 3.0\n    profile: by_hand\n")
    run(replay.main, monkeypatch, *flight.files(), "--config", path, "--picture", tmp_path / "p")
    assert "takeoff_height: 2.0 -> 3.0" in capsys.readouterr().out


def test_what_cannot_be_read_or_written_is_told_without_a_traceback(
    flight, tmp_path, monkeypatch, capsys
):
    assert run(replay.main, monkeypatch, tmp_path / "none.mcap") == 2
    assert "No such file" in capsys.readouterr().err
    nowhere = tmp_path / "none" / "p.svg"
    assert run(replay.main, monkeypatch, *flight.files(), "--picture", nowhere) == 2
    assert "No such file" in capsys.readouterr().err


def test_a_fifo_in_place_of_the_settings_is_not_waited_for(flight, tmp_path, monkeypatch, capsys):
    os.mkfifo(tmp_path / "fifo")
    assert run(replay.main, monkeypatch, *flight.files(), "--config", tmp_path / "fifo") == 2
    assert capsys.readouterr().err == f"replay: {tmp_path}/fifo: no regular file but a FIFO\n"


def test_the_picture_goes_over_nothing_that_was_read(flight, other, monkeypatch, capsys):
    config = other("mode: SHADOW")
    for one in (*flight.files(), config):
        before = one.read_bytes()
        given = (*flight.files(), "--config", config, "--picture", one)
        assert run(replay.main, monkeypatch, *given) == 2
        assert f"replay: {one} is read here" in capsys.readouterr().err
        assert one.read_bytes() == before


def test_a_hostile_name_moves_no_cursor(tmp_path, monkeypatch, capsys):
    flight = Flight(tmp_path)
    flight.reason = "\x1b[2J\x07falls\n\u202e"
    flight.fly()
    flight.land()
    picture = tmp_path / "p.svg"
    run(replay.main, monkeypatch, tmp_path, "--picture", picture)
    out = capsys.readouterr().out
    assert not set("\x1b\x07\u202e") & set(out + picture.read_text())
