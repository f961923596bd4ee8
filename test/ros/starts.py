"""Many starts of a node that soon end, each in a process of its own that parts from one which has
imported what all need: that takes longer than such a start."""

import json
import subprocess
import sys
from collections.abc import Sequence

from chute_ros.links.registered import links, module_of

#: How long all of them may take, s.
_PATIENCE = 60.0
#: As `python -m MODULE ARGUMENTS`, from the import of the node on.
_PROGRAM = """
import importlib, json, os, runpy, sys, tempfile

module, imported, cases = json.loads(sys.argv[1])
importlib.import_module(imported)
told = []
for arguments in cases:
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        if not (child := os.fork()):
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            sys.argv = [module, *arguments]
            runpy.run_module(module, run_name="__main__", alter_sys=True)
            sys.exit()
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0), err.seek(0)
        told.append((code, out.read().decode(), err.read().decode()))
print(json.dumps(told))
"""


def starts(node: str, *cases: Sequence[str]) -> list[tuple[int, str, str]]:
    """(exit code, standard output, standard error) of this node with each of these arguments."""
    known = links()
    place = known[node].node if node in known else f"chute_ros.ros.{node}_node:"
    given = json.dumps([module_of(node), place.partition(":")[0], cases])
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, given],
        capture_output=True,
        text=True,
        timeout=_PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [tuple(one) for one in json.loads(done.stdout)]
