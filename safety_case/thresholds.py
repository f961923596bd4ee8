"""The page of every threshold of every shipped profile."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from safety_case.documents import ROOT, list_table, plain, write_made
from safety_case.evidence import age

_PROFILES = ROOT / "config" / "profiles"
_COMPARE = ROOT / "docs" / "evidence" / "compare.md"
_CURVE = "\n## False against missed\n"
_INTRODUCTION = """
From the shipped profiles themselves. WHY AND FROM WHERE is the text that stands beside the value
in the profile, and of a rule also what stands above all rules; "ours" means that no public source
gives it. How a rule counts:
``docs/reference/rules.md``.
"""
_MOVED = """
What changes when limits move, by ``make compare`` (docs/evidence/compare.md): each guard scaled
by these factors. Of this product the time of every rule (``for``) is scaled and no other limit,
of a peer its limits. A cell has the flights missed or late, in percent of those that only a
parachute could save, and the flights ended although they went well, in percent of all. The
campaign draws faults around each failure, far more often than flights have them: these shares
compare guards, and are no rates of a fleet.
"""
_RULES = "\nrules:\n"
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
#: How long a rule must hold and the like, as a profile names them.
_COUNTS = ("for", "leak", "samples", "needed", "doubted", "clears")


def write() -> None:
    """From config/profiles."""
    parts = [("", _INTRODUCTION), ("What changes when limits move", _moved())]
    for path in sorted(_PROFILES.glob("*.yaml")):
        text = path.read_text(encoding="utf-8")
        parts.append((f"{path.stem}", _profile(yaml.safe_load(text), text)))
    write_made("thresholds", "Thresholds", parts)


def problems(folder: Path = _PROFILES) -> Iterable[str]:
    """Each value and rule without its why, in a line."""
    for path in sorted(folder.glob("*.yaml")):
        text = path.read_text(encoding="utf-8")
        profile, comments = yaml.safe_load(text), dict(_comments(text))
        for name in [*_values(profile), *profile.get("measurements", ())]:
            if not comments.get(name):
                said = "say in a comment above it where it is from, or 'ours' and the reason"
                yield f"{path.name}: {name} has no why; {said}"
        shared, of_rules = _rule_comments(text)
        for name, rule in profile["rules"].items():
            if not rule.get("source"):
                yield f"{path.name}: the rule '{name}' has no source"
                continue
            why = " ".join((rule["source"], *of_rules.get(name, ()), shared))
            known = {float(one) for one in _NUMBER.findall(why)}
            for what, value in _limits_of(rule):
                if abs(value) not in known:
                    said = "name it in the rule's source or a comment: where it is from, or 'ours'"
                    yield f"{path.name}: {what} of the rule '{name}' has no why; {said}"


def _limits_of(rule: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Each limit in words, and its value."""
    for condition in rule["conditions"]:
        for key in ("above", "below", "until"):
            if key in condition:
                yield f"{condition['measurement']} {key} {condition[key]}", float(condition[key])
    if "for" in rule:
        yield f"for {rule['for']}", float(rule["for"])


def _values(profile: Mapping[str, Any]) -> list[str]:
    return [key for key in profile if key not in ("profile", "rules", "measurements")]


def _profile(profile: Mapping[str, Any], text: str) -> str:
    comments = dict(_comments(text))
    values = [(f"``{key}``", str(profile[key]), plain(comments[key])) for key in _values(profile)]
    for name, limits in profile.get("measurements", {}).items():
        told = ", ".join(f"{key} {value}" for key, value in limits.items())
        values.append((f"``measurements: {name}``", plain(told), plain(comments[name])))
    shared, of_rules = _rule_comments(text)
    rules = [
        (
            f"**{plain(name)}**\n\n{plain(rule.get('says', ''))}",
            _limits(rule),
            "\n\n".join(plain(one) for one in (rule["source"], *of_rules.get(name, ()))),
        )
        for name, rule in profile["rules"].items()
    ]
    tables = [plain(shared)] if shared else []
    if values:
        tables.append(list_table(("value", "is", "why and from where"), values, (20, 16, 64)))
    head = ("rule", "holds while, and how long", "why and from where")
    tables.append(list_table(head, rules, (20, 36, 44)))
    return "\n\n".join(tables)


def _limits(rule: Mapping[str, Any]) -> str:
    lines = [f"- {plain(_condition(one))}" for one in rule["conditions"]]
    counts = ", ".join(f"{key} {rule[key]}" for key in _COUNTS if key in rule)
    return "\n".join([*lines, "", f"{plain(rule['action'])}{'; ' if counts else ''}{counts}"])


def _condition(condition: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {_word(value)}" for key, value in condition.items())


def _word(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return " or ".join(map(str, value)) if isinstance(value, list) else str(value)


def _comments(text: str) -> Iterator[tuple[str, str]]:
    """Of the keys before the rules: the comment above each."""
    for line, said in _commented(text.partition(_RULES)[0]):
        if found := re.match(r"\s*([\w_]+):", line):
            yield found[1], said


def _rule_comments(text: str) -> tuple[str, dict[str, list[str]]]:
    """Of the rules: what stands above the first, and rule -> the comments above it and in it."""
    shared, rule = "", ""
    of_rules: dict[str, list[str]] = {}
    for line, said in _commented(text.partition(_RULES)[2]):
        above = said
        if found := re.match(r"  (\S[^:]*):$", line):
            if not rule:
                shared, above = said, ""
            rule = found[1]
            of_rules[rule] = []
        if above:
            of_rules[rule].append(above)
    return shared, of_rules


def _commented(text: str) -> Iterator[tuple[str, str]]:
    """Each line that is no comment, with the comment just above it."""
    said: list[str] = []
    for line in text.splitlines():
        if line.lstrip().startswith("#"):
            said.append(line.strip().removeprefix("#").strip())
        else:
            yield line, " ".join(said)
            said = []


def _moved() -> str:
    """The table of the curve in docs/evidence/compare.md."""
    section = _COMPARE.read_text(encoding="utf-8").split(_CURVE, 1)[1].split("\n## ", 1)[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    head, *body = ([cell.strip() for cell in line.strip("| ").split("|")] for line in lines)
    widths = [28, *([72 // (len(head) - 1)] * (len(head) - 1))]
    return f"{_MOVED}\n{age(_COMPARE.name)}\n\n{list_table(head, body, widths)}"
