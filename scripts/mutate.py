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
    "gate": ("gate", "wrong_heights", "gate_word_for_word"),
    "machine": ("machine",),
    "counter": ("counter", "counter_to_last_sample"),
    "lease": ("lease", "lease_every_field"),
    "conditions/base": ("conditions", "conditions_own"),
    "conditions/measurement": (
        "conditions",
        "wrong_heights",
        "conditions_at_limits",
        "vehicle_rests",
        "profile_absurd",
        "profile_mistakes_in_full",
    ),
    "conditions/link": ("conditions", "conditions_at_limits", "profile_mistakes_in_full"),
    "conditions/autopilot": (
        "conditions",
        "killed_aloft",
        "conditions_at_limits",
        "conditions_own",
        "profile_mistakes_in_full",
    ),
    "conditions/device": ("conditions", "conditions_own", "profile_mistakes_in_full"),
    "flight": (
        "flight_picture",
        "against_its_word",
        "gate",
        "killed_aloft",
        "wrong_heights",
        "low",
        "flight_or_ground_at_limits",
    ),
    "readings": ("flight_picture", "wrong_heights", "flight_or_ground_at_limits"),
    "policy": ("policy", "conditions", "gate", "vehicle_rests", "policy_word_for_word"),
    "orders": (
        "core_requests",
        "core_device_blocks",
        "core_deploy",
        "gate",
        "ladder",
        "against_its_word",
        "last_defences",
        "core_lost",
        "orders_with_reasons",
    ),
    "deploying": (
        "ladder",
        "core_deploy",
        "core_lost",
        "against_its_word",
        "last_defences",
        "low",
        "deploying_word_for_word",
    ),
    "turn": ("core_links", "core_deploy", "steps_word_for_word"),
    "answers": ("core_deploy", "core_requests", "core_lost", "steps_word_for_word"),
    "sending": (
        "ladder",
        "core_deploy",
        "core_requests",
        "core_lost",
        "gate",
        "last_defences",
        "steps_word_for_word",
    ),
    "requests": (
        "core_requests",
        "core_device_blocks",
        "gate",
        "against_its_word",
        "requests_word_for_word",
    ),
    "link_reports": ("core_links", "core_lost", "field_failures", "reports_word_for_word"),
    "vehicle_reports": ("field_failures", "against_its_word", "reports_word_for_word"),
    "action_reports": ("core_deploy", "core_lost", "reports_word_for_word"),
    "airborne": ("against_its_word", "come_down", "core_links", "core_wakes_and_words"),
    "blocking": ("core_links", "core_requests", "armed", "core_wakes_and_words"),
    "wakes": ("core_wakes_and_words", "policy_word_for_word"),
    "core": (
        "core_links",
        "core_deploy",
        "core_requests",
        "core_lost",
        "against_its_word",
        "core_wakes_and_words",
    ),
    "pending": ("core_deploy", "core_requests", "core_lost", "ladder", "state_remembered"),
    "state": ("core_deploy", "core_requests", "core_lost", "ladder", "state_remembered"),
    "config": ("config", "config_at_limits"),
    "decision_gate": ("decision_gate", "decision_gate_at_limits"),
    "epochs": ("lease",),
    "handover": ("handover", "handover_every_field"),
    "resume": ("resume",),
    "link_evidence": ("link_evidence", "link_evidence_at_limits"),
    "measurements": ("measurements", "measurements_at_limits"),
    "measured": ("measurements", "wrong_heights", "vehicle_rests", "measurements_at_limits"),
    "samples": ("measurements", "wrong_heights", "measurements_at_limits"),
    "preflight": ("preflight", "preflight_word_for_word"),
    "profile_reader": ("profile_reader", "profile_absurd", "profile_mistakes_in_full"),
    "profile_limits": ("profile_absurd",),
    "yaml_lines": ("profile_reader", "profile_absurd", "yaml_mistakes_in_full"),
    "rules": ("profile_reader", "profiles", "conditions", "rules_by_themselves"),
    "clock_steps": ("clock_steps",),
    "codec": ("codec", "codec_every_shape"),
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
    own = [name for name in own if (folder / name).is_file()]
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
