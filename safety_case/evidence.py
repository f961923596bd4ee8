"""How old the pages of docs/evidence are: runs wrote them, `make case` does not."""

from __future__ import annotations

import subprocess

from safety_case.documents import ROOT, write_made

_PAGES = ROOT / "docs" / "evidence"
#: Lines that a new run changes and a corrected word does not: how long it took, or a table.
_RESULTS = ("^Written by .*[0-9] s,", r"^\|.*[0-9]")
#: What the numbers depend on most.
_DECIDES = {
    "profiles": "config/profiles",
    "supervisor": "chute_ros/supervisor",
    "campaign": "chute_ros/campaign",
}
_INTRODUCTION = """
A run wrote each of these pages, of the version of that day. What was committed since then in
``config/profiles``, ``chute_ros/supervisor`` and ``chute_ros/campaign`` is counted, a corrected
comment as well as a new limit. A page that is older than the rules shows what they were. Where a
page does not say how long its run took, the commit is the last one that changed a table of it, and
the run may be older.
"""


def write() -> None:
    """A part of the introduction."""
    lines = "\n".join(f"- {age(path.name)}" for path in sorted(_PAGES.glob("*.md")))
    write_made("evidence", "How old the evidence is", [("", f"{_INTRODUCTION}\n{lines}")])


def keep_place() -> None:
    """For a check, which needs no ages."""
    write_made("evidence", "How old the evidence is", [("", _INTRODUCTION)])


def age(name: str) -> str:
    """By which commit this page was written, and what changed since, in a line."""
    page = f"docs/evidence/{name}"
    # A shallow clone takes its oldest commit for the one that wrote everything.
    if _git("rev-parse", "--is-shallow-repository") != "false":
        return f"``{page}``: when it was written is not known: this is no whole clone."
    for lines in _RESULTS:
        if found := _git("log", "-1", "--follow", "--format=%h %cs", f"-G{lines}", "--", page):
            break
    else:
        return f"``{page}``: when it was written is not known: it is in no commit."
    commit, date = found.split()
    counts = {
        what: int(_git("rev-list", "--count", f"{commit}..HEAD", "--", folder))
        for what, folder in _DECIDES.items()
    }
    changed = ", ".join(f"{what} {count}" for what, count in counts.items() if count)
    told = f"commits since: {changed}" if changed else f"unchanged since: {', '.join(_DECIDES)}"
    return f"``{page}``: numbers of {date}, commit {commit}; {told}."


def _git(*arguments: str) -> str:
    """What git says; nothing, where it cannot."""
    command = ["git", "-C", str(ROOT), *arguments]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return ended.stdout.strip() if ended.returncode == 0 else ""
