"""What the tools that read recordings share: their files, and their errors."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NoReturn

from chute_ros.errors import ChuteError
from chute_ros.plain_text import plain
from chute_ros.tools.page_file import HTML, write_page
from chute_ros.tools.recordings import chosen, listed


def recording_options(program: str, description: str | None) -> argparse.ArgumentParser:
    """The parser of program, with files to read."""
    options = argparse.ArgumentParser(
        program, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        type=Path,
        help="files of a black box in their order, or its folder",
    )
    options.add_argument(
        "--recording",
        type=int,
        metavar="NUMBER",
        help="which recording, if the files are of several (without it they are listed)",
    )
    return options


def make_each(
    program: str,
    given: argparse.Namespace,
    one: str,
    make: Callable[[list[Path], Path | None], None],
) -> bool:
    """Call make(files, --output) for each recording that was chosen, and tell each that it cannot
    make (ChuteError); whether all were made. one: what --output is ("one page")."""
    made = True
    try:
        found = chosen(given.files, given.recording, partial(remark, program))
        if given.output is not None and len(found) > 1:
            text = f"--output is {one}, and these are {len(found)} recordings"
            raise ChuteError(f"{text}: choose one with --recording NUMBER\n{listed(found)}")
        for recording in found:
            try:
                make(recording.files, given.output)
            except ChuteError as error:
                made = False
                complain(program, error)
    except ChuteError as error:
        made = False
        complain(program, error)
    return made


def write_pages(
    program: str, description: str | None, ending: str, page: Callable[[list[Path]], str]
) -> NoReturn:
    """Run program, which writes an HTML page of each recording beside its first file, with this
    ending, and prints where. Exit code 0: written; 2: a recording cannot be read, or a page cannot
    be written."""
    options = recording_options(program, description)
    options.add_argument(
        "--output", type=Path, metavar="HTML", help=f"output file (default: FILE{ending})"
    )

    def make(files: list[Path], output: Path | None) -> None:
        path = output or files[0].with_name(f"{files[0].name}{ending}")
        write_page(path, page(files), HTML, files)
        print(path, flush=True)

    sys.exit(0 if make_each(program, options.parse_args(), "one page", make) else 2)


def remark(program: str, text: str) -> None:
    """On standard error, what is no error."""
    print(plain(f"{program}: {text}"), file=sys.stderr)


def complain(program: str, error: ChuteError) -> None:
    """Why it cannot go on, without what would move a cursor."""
    for line in f"{program}: {error}".splitlines():
        print(plain(line), file=sys.stderr)
