"""make case: the input to a safety case, as pages (case/html), for print (case/pdf), and the bill
of materials (case/sbom.cdx.json).

--check only looks whether everything is traced: exit code 1 and a line for each that is not.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from safety_case import check, evidence, minimum_height, single_failures, supply, thresholds
from safety_case.documents import ROOT, Node, NotReadError, read, remove_made, strictdoc

_OUT = ROOT / "case"
#: What scripts/browser.sh is content with.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def main() -> None:
    """Check, and make the pages. Exit code 1: something is not traced, or cannot be read."""
    options = argparse.ArgumentParser("make case", description=__doc__)
    options.add_argument("--check", action="store_true", help="make no pages")
    chosen = options.parse_args()
    try:
        remove_made()
        evidence.keep_place()
        nodes = read()
        if found := [*check.problems(nodes, ROOT), *thresholds.problems()]:
            sys.exit("\n".join(f"safety case: {one}" for one in found))
        told = f"{len(nodes)} requirements, rows and texts are traced"
        if chosen.check:
            print(f"safety case: {told}")
            return
        evidence.write()
        _make(nodes)
        print(f"{told}: {_OUT}/html/index.html, {_OUT}/pdf")
    except NotReadError as error:
        sys.exit(f"safety case: {error}")
    finally:
        remove_made()


def _tell(what: str) -> None:
    print(f"safety case: {what}", file=sys.stderr, flush=True)


def _make(nodes: list[Node]) -> None:
    shutil.rmtree(_OUT, ignore_errors=True)
    _OUT.mkdir()
    try:
        single_failures.write(nodes)
        thresholds.write()
        minimum_height.write()
        _tell("what is installed, and what the index knows of it")
        supply.write(_OUT)
        _tell("pages and print, a minute or two")
        strictdoc(
            "--formats=html,html2pdf",
            f"--output-dir={_OUT / 'work'}",
            f"--chromedriver={shutil.which('chromedriver')}",
            f"--chrome-binary={next(filter(None, map(shutil.which, _BROWSERS)))}",
        )
        Path(_OUT / "work" / "html").rename(_OUT / "html")
        Path(_OUT / "work" / "html2pdf" / "pdf").rename(_OUT / "pdf")
        for path in (_OUT / "pdf").iterdir():
            # StrictDoc leaves long ones for their owner alone.
            path.chmod(0o644)
    finally:
        shutil.rmtree(_OUT / "work", ignore_errors=True)


if __name__ == "__main__":
    main()
