#!/usr/bin/env python3
"""Generate the Python module of the MAVLink dialect that parachute.xml defines.

Usage: python3 generate_dialect.py OUTPUT.py

The module speaks MAVLink 2 and reads MAVLink 1 as well. It needs pymavlink to be generated, but
not to be imported. The same parachute.xml and the same pymavlink give the same bytes.
"""

import contextlib
import io
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from xml.parsers.expat import ExpatError

DIALECT = Path(__file__).resolve().with_name("parachute.xml")

# The oldest release that is known to fit. Its common.xml lacks exactly what parachute.xml adds.
OLDEST_PYMAVLINK = (2, 4, 50)
REMEDY = "run: pip install pymavlink==2.4.50 (see requirements/ in the repository root)"


class GenerationError(Exception):
    """The dialect cannot be generated; the text is one line that says why."""


def import_pymavlink():
    """Return the package pymavlink and its generator, or say what to install."""
    try:
        import pymavlink
        from pymavlink.generator import mavgen, mavparse
    except ImportError as error:
        reason = f"{sys.executable} cannot import pymavlink ({error})"
        raise GenerationError(f"{reason}; {REMEDY}") from error
    version = tuple(int(number) for number in re.findall(r"\d+", pymavlink.__version__)[:3])
    if version < OLDEST_PYMAVLINK:
        raise GenerationError(f"pymavlink {pymavlink.__version__} is too old; {REMEDY}")
    return pymavlink, mavgen, mavparse


def generate(output):
    """Write the Python module of the dialect to the path output."""
    pymavlink, mavgen, mavparse = import_pymavlink()
    definitions = Path(pymavlink.__file__).parent / "dialects" / "v20"
    if not (definitions / "common.xml").is_file():
        raise GenerationError(f"pymavlink {pymavlink.__version__} has no common.xml; {REMEDY}")
    with tempfile.TemporaryDirectory(prefix="chute_dialect_") as folder:
        # mavgen looks for an included file only beside the file that includes it.
        for definition in [*definitions.glob("*.xml"), DIALECT]:
            shutil.copyfile(definition, Path(folder, definition.name))
        module = Path(folder, "parachute.py")
        options = mavgen.Opts(str(module), mavparse.PROTOCOL_2_0, "Python3", validate=False)
        chatter = io.StringIO()
        generated = False
        try:
            with contextlib.redirect_stdout(chatter), contextlib.suppress(SystemExit):
                generated = mavgen.mavgen(options, [str(Path(folder, DIALECT.name))])
        except (mavparse.MAVParseError, ExpatError) as error:
            raise GenerationError(f"{DIALECT}: {error}") from error
        if not generated:
            errors = re.findall(r"^ERROR:? *(.*)", chatter.getvalue(), re.MULTILINE)
            reason = "; ".join(errors).replace(folder + os.sep, "") or "mavgen failed"
            raise GenerationError(f"{DIALECT} with pymavlink {pymavlink.__version__}: {reason}")
        put_in_place(module, output)


def put_in_place(module, output):
    """Copy module to output whole or not at all: half a module would look up to date."""
    unfinished = Path(f"{output}.{os.getpid()}.tmp")
    try:
        shutil.copyfile(module, unfinished)
        os.replace(unfinished, output)
    except OSError as error:
        raise GenerationError(f"cannot write {output}: {error.strerror}") from error
    finally:
        unfinished.unlink(missing_ok=True)


def main(arguments):
    """Run from the command line; return the exit code."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: generate_dialect.py OUTPUT.py", file=sys.stderr)
        return 2
    try:
        generate(arguments[0])
    except (GenerationError, OSError) as error:
        print(f"generate_dialect.py: error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
