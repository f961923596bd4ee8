"""One target under libFuzzer: python -m fuzz.child CALL TARGET FOLDER [its arguments].

CALL: a program that calls this again with the same and other arguments, as merging does; FOLDER:
where findings go. It has a process of its own: libFuzzer ends the one that it runs in.
"""

from __future__ import annotations

import sys
from pathlib import Path

#: What gets instruments: the readers, and the libraries that they read with.
_WATCHED = (
    *("chute_ros", "chute_msgs.mavlink", "can.interfaces.slcan", "mcap", "yaml"),
    *("dronecan.dsdl.common", "dronecan.transport"),
)
#: Lines of this program among those of libFuzzer.
FOUND, SLOWEST, LARGEST = "fuzz found: ", "fuzz slowest: ", "fuzz largest: "


def main() -> None:
    """Never returns."""
    call, name, folder, *arguments = sys.argv[1:]
    import atheris  # type: ignore[import-untyped]

    with atheris.instrument_imports(include=list(_WATCHED), enable_loader_override=False):
        from fuzz.targets import target_of

        target = target_of(name)
    from fuzz.findings import Findings

    findings = Findings(target, Path(folder))
    told = {SLOWEST: 0.0, LARGEST: 0.0}

    def tell(what: str, value: float, text: str) -> None:
        # Now and then only: it is asked for at the end, which nobody is told of.
        if value > 1.1 * told[what]:
            told[what] = value
            print(what + text, flush=True)

    def one_input(data: bytes) -> None:
        found = findings.try_input(data)
        if found:
            print(FOUND + found, flush=True)
        tell(SLOWEST, findings.slowest, f"{findings.slowest * 1e3:.1f}")
        tell(LARGEST, findings.largest, str(findings.largest))

    atheris.Setup([call, *arguments, f"-max_len={target.longest}"], one_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
