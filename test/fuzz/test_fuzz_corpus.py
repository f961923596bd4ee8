"""What the fuzzer reached is reached again, without the fuzzer; and it would be noticed."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz_subjects import BROKEN, Fills, Grows, Reader

import fuzz.target
from fuzz.findings import Findings
from fuzz.stored import CORPUS, archive, store, stored
from fuzz.target import Target, WrongError, attempt, check_size, live_long
from fuzz.targets import GROUPS, NAMES, target_of, targets_in

#: Bytes of all stored inputs together, at most.
LARGEST_CORPUS = 1_000_000


@pytest.mark.parametrize("name", NAMES)
def test_every_stored_input_is_read_as_it_must(name: str) -> None:
    target = target_of(name)
    inputs = stored(name)
    assert inputs
    for data in inputs:
        attempt(target, data)


@pytest.mark.parametrize("name", [name for name in NAMES if target_of(name).most])
def test_one_instance_that_reads_them_all_stays_small(name: str) -> None:
    target = target_of(name)
    subject = target.begin()
    for data in stored(name):
        subject.feed(data)
    assert check_size(target, subject)


def test_the_corpus_is_small_and_has_every_target() -> None:
    assert {*CORPUS.iterdir()} == {archive(name) for name in NAMES}
    assert sum(archive(name).stat().st_size for name in NAMES) < LARGEST_CORPUS


def test_the_same_inputs_are_stored_as_the_same_bytes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("fuzz.stored.CORPUS", tmp_path)
    assert stored("new") == [], "of a target that has none yet"
    store("new", [b"", b"\0two", b"one"])
    first = archive("new").read_bytes()
    assert sorted(stored("new")) == [b"", b"\0two", b"one"]
    store("new", [b"one", b"\0two", b"", b"one"])
    assert archive("new").read_bytes() == first


@pytest.mark.parametrize("group", GROUPS)
def test_the_table_names_what_is_there(group: str) -> None:
    assert tuple(one.name for one in targets_in(group)) == GROUPS[group]


# -- the harness would notice -------------------------------------------------------------------


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_found_once_and_its_file_replays_it(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fuzz.target, "LONGEST_TIME", 0.2)
    broken = BROKEN[name]
    healthy = Findings(Target(name, "healthy", broken.healthy, broken.most), tmp_path)
    assert not healthy.try_input(broken.data)
    target = Target(name, "broken", broken.make, broken.most)
    findings = Findings(target, tmp_path)
    path = findings.try_input(broken.data)
    assert broken.told in Path(f"{path}.txt").read_text()
    assert not findings.try_input(broken.data), "the same mistake is told once"
    again = Findings(target, tmp_path / "again")
    assert again.try_input(Path(path).read_bytes())


def test_what_grows_is_found_by_the_variations_of_one_input() -> None:
    target = Target("grows", "broken", Grows, 60)
    attempt(target, bytes(range(100)))
    told = r"grows: Grows.kept has \d+ entries, 60 are allowed"
    with pytest.raises(WrongError, match=told):
        live_long(target, bytes(range(100)))


def test_what_grows_only_up_to_a_bound_is_not_taken_for_it() -> None:
    target = Target("fills", "healthy", Fills, 60)
    assert live_long(target, bytes(range(100))) == Fills.MOST


def test_an_instance_lives_no_longer_than_it_grows() -> None:
    lives: list[Reader] = []

    def begin() -> Reader:
        lives.append(Reader())
        return lives[-1]

    live_long(Target("reads", "healthy", begin, 60), b"a")
    assert len(lives) == 1
    assert lives[0].inputs == 10


def test_as_much_time_goes_into_long_lives_as_into_single_inputs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    now, lived = [0.0], list[bytes]()

    def life_of_three_seconds(target: Target, data: bytes) -> int:
        now[0] += 3.0
        lived.append(data)
        return 1

    monkeypatch.setattr("fuzz.findings.attempt", lambda target, data: 1.0)
    monkeypatch.setattr("fuzz.findings.live_long", life_of_three_seconds)
    monkeypatch.setattr("fuzz.findings.time.process_time", lambda: now[0])
    findings = Findings(Target("reads", "healthy", Reader, 60), tmp_path)
    for number in range(1, 13):
        findings.try_input(bytes((number,)))
    assert lived == [b"\1", b"\3", b"\6", b"\x09", b"\x0c"]
