"""Mutation testing of chute_ros/supervisor: changes it a little, many times, and runs its tests.

A mutant that no test notices is a survivor. Each survivor must be explained in
docs/evidence/mutation.md as "`the line` becomes `the changed line`"; the run fails if one is not.
The run works in a copy, first with the tests of the module, then, for the survivors, with all
tests but the random ones.

    make mutate [MODULES="gate counter"]
"""

from __future__ import annotations

import argparse
import collections
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "evidence" / "mutation.md"
#: Module -> the tests that were written for it.
TESTS = {
    "gate": ("gate", "wrong_heights"),
    "machine": ("machine",),
    "counter": ("counter",),
    "lease": ("lease",),
    "conditions/base": ("conditions",),
    "conditions/measurement": (
        "conditions",
        "wrong_heights",
        "vehicle_rests",
        "profile_absurd",
        "profile_reader",
    ),
    "conditions/link": ("conditions", "profile_reader"),
    "conditions/autopilot": ("conditions", "killed_aloft", "profile_reader"),
    "conditions/device": ("conditions", "profile_reader"),
    "flight": (
        "flight_or_ground",
        "against_its_word",
        "gate",
        "killed_aloft",
        "wrong_heights",
        "low",
    ),
    "readings": (
        "flight_or_ground",
        "wrong_heights",
    ),
    "policy": ("policy", "conditions", "gate", "vehicle_rests"),
    "orders": (
        "requests_of_people",
        "device_blocks",
        "deploy",
        "gate",
        "against_its_word",
        "last_defences",
    ),
    "deploying": ("deploy", "against_its_word", "last_defences", "low"),
    "turn": ("reports", "deploy", "steps_word_for_word"),
    "answers": ("deploy", "requests_of_people", "steps_word_for_word"),
    "sending": ("deploy", "requests_of_people", "gate", "last_defences", "steps_word_for_word"),
    "requests": ("requests_of_people", "device_blocks", "gate", "against_its_word"),
    "link_reports": ("reports", "field_failures"),
    "vehicle_reports": ("reports", "field_failures", "against_its_word"),
    "action_reports": ("deploy", "reports"),
    "airborne": ("against_its_word", "come_down", "reports", "core_wakes_and_words"),
    "blocking": ("reports", "requests_of_people", "armed", "core_wakes_and_words"),
    "wakes": ("core_wakes_and_words",),
    "core": (
        "reports",
        "deploy",
        "requests_of_people",
        "against_its_word",
        "core_wakes_and_words",
    ),
    "pending": ("deploy", "requests_of_people", "state_remembered"),
    "state": ("deploy", "requests_of_people", "state_remembered"),
    "config": ("config",),
    "decision_gate": ("decision_gate",),
    "epochs": ("lease",),
    "handover": ("handover",),
    "resume": ("resume",),
    "link_evidence": ("link_evidence",),
    "measurements": ("measurements",),
    "measured": ("measurements", "wrong_heights", "vehicle_rests"),
    "samples": ("measurements", "wrong_heights"),
    "preflight": ("preflight",),
    "profile_reader": ("profile_reader", "profile_absurd"),
    "profile_limits": ("profile_absurd",),
    "yaml_lines": ("profile_reader", "profile_absurd", "yaml_mistakes_in_full"),
    "rules": ("profile_reader", "profiles", "conditions", "rules_by_themselves"),
    "clock_steps": ("clock_steps",),
    "codec": ("codec",),
    "record": ("record_replay",),
    "inputs": ("codec",),
}
#: The random ones take longer than all others together.
SLOW = ("properties", "properties_loop", "properties_rules", "properties_time", "exhaustive_small")
_SETTINGS = """\
[mutmut]
source_paths=chute_ros
only_mutate=chute_ros/supervisor/{module}.py
pytest_add_cli_args_test_selection=
    {tests}
pytest_add_cli_args=
    -p
    no:cacheprovider
also_copy=
    config
    scripts
"""


def main() -> None:
    """Run, print every survivor, and fail on one that is not explained."""
    options = argparse.ArgumentParser("mutate", description=__doc__)
    options.add_argument("modules", nargs="*", default=list(TESTS), metavar="MODULE")
    options.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at once")
    options.add_argument("--quick", action="store_true", help="only the tests of the module")
    given = options.parse_args()
    if unknown := [one for one in given.modules if one not in TESTS]:
        options.error(f"{unknown[0]}: need one of {', '.join(TESTS)}")
    page, unexplained = PAGE.read_text(), 0
    for module in given.modules:
        with tempfile.TemporaryDirectory(prefix="mutate_") as folder:
            copied = pathlib.Path(folder)
            copy_tree(copied)
            counts, survivors = run(copied, module, given.quick, given.jobs)
        every, killed = sum(counts.values()), counts["killed"]
        print(f"| {module}.py | {every} | {killed} | {every - killed} |", flush=True)
        for line, before, after in survivors:
            known = f"`{before}` becomes `{after}`" in page
            unexplained += not known
            what = "" if known else "  not explained"
            print(f"  {module}.py:{line}: `{before}` becomes `{after}`{what}", flush=True)
    if unexplained:
        sys.exit(f"{unexplained} survivors are not explained in {PAGE.relative_to(ROOT)}")


def copy_tree(folder: pathlib.Path) -> None:
    """The part of the repository that the tests of the supervisor need."""
    for name in ("chute_ros", "config", "scripts", "test/supervisor"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("test/conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)


def run(
    folder: pathlib.Path, module: str, quick: bool, jobs: int
) -> tuple[dict[str, int], list[tuple[int, str, str]]]:
    """How many mutants there were of each verdict, and the survivors: line, before, after."""
    found = folder / "test" / "supervisor"
    own = [f"test/supervisor/test_{name}.py" for name in TESTS[module]]
    every = [
        f"test/supervisor/{path.name}"
        for path in sorted(found.glob("test_*.py"))
        if path.stem.removeprefix("test_") not in SLOW
    ]
    verdicts = mutated(folder, module, own, [], jobs)
    left = [name for name, verdict in verdicts.items() if verdict != "killed"]
    if left and not quick:
        verdicts |= mutated(folder, module, every, left, jobs)
    left = [name for name, verdict in verdicts.items() if verdict != "killed"]
    source = (folder / "chute_ros" / "supervisor" / f"{module}.py").read_text().splitlines()
    return collections.Counter(verdicts.values()), [changed(folder, source, one) for one in left]


def mutated(
    folder: pathlib.Path, module: str, tests: list[str], names: list[str], jobs: int
) -> dict[str, str]:
    """Mutant -> what became of it with these tests; names: only of these, if any."""
    settings = _SETTINGS.format(module=module, tests="\n    ".join(tests))
    (folder / "setup.cfg").write_text(settings)
    mutmut("run", "--max-children", str(jobs), *names, folder=folder)
    lines = mutmut("results", "--all", "true", folder=folder).splitlines()
    told = dict(line.strip().split(": ") for line in lines if ": " in line)
    return {name: verdict for name, verdict in told.items() if not names or name in names}


def changed(folder: pathlib.Path, source: list[str], name: str) -> tuple[int, str, str]:
    """The line of a mutant, and what became of it."""
    diff = mutmut("show", name, folder=folder).splitlines()
    before, after = (
        " ".join(line[1:].strip() for line in diff if line[:1] == sign and line[:3] != sign * 3)
        for sign in "-+"
    )
    first = next((line[1:].strip() for line in diff if line[:1] == "-" and line[:3] != "---"), "")
    line = next((n for n, text in enumerate(source, start=1) if text.strip() == first), 0)
    return line, before, after


def mutmut(*arguments: str, folder: pathlib.Path) -> str:
    """What mutmut says."""
    command = [sys.executable, "-m", "mutmut", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode and not done.stdout:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
