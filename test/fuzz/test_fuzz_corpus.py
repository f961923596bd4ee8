"""What the fuzzer ever reached is reached again, without the fuzzer; and it would be noticed."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz_subjects import BROKEN, Grows

import fuzz.target
from fuzz.findings import Findings
from fuzz.run import CORPUS
from fuzz.target import Target, WrongError, attempt, check_size, live_long
from fuzz.targets import GROUPS, NAMES, target_of, targets_in

#: Bytes of all stored inputs together, at most.
LARGEST_CORPUS = 1_000_000


def stored(name: str) -> list[bytes]:
    """The stored inputs of a target."""
    return [one.read_bytes() for one in sorted((CORPUS / name).iterdir())]


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
    assert check_size(target, subject) > 0


def test_the_corpus_is_small_and_has_every_target() -> None:
    assert sorted(one.name for one in CORPUS.iterdir()) == sorted(NAMES)
    files = [one for one in CORPUS.rglob("*") if one.is_file()]
    assert sum(one.stat().st_size for one in files) < LARGEST_CORPUS


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
    healthy = Findings(Target(name, "healthy", broken.healthy, 0), tmp_path)
    assert not healthy.try_input(broken.data)
    target = Target(name, "broken", broken.make, 0)
    findings = Findings(target, tmp_path)
    path = findings.try_input(broken.data)
    assert broken.told in Path(f"{path}.txt").read_text()
    assert not findings.try_input(broken.data), "the same mistake is told once"
    again = Findings(target, tmp_path / "again")
    assert again.try_input(Path(path).read_bytes())


def test_what_grows_is_found_by_the_variations_of_one_input() -> None:
    target = Target("grows", "broken", Grows, 60)
    attempt(target, bytes(range(100)))
    with pytest.raises(WrongError, match=r"grows: it holds \d+ objects, 60 are allowed"):
        live_long(target, bytes(range(100)))
