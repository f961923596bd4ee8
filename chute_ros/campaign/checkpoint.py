"""What was flown so far as a file, so that a campaign of hours may be interrupted and go on."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import chute_ros
from chute_ros.campaign.campaign import FlightSummary, Tally
from chute_ros.campaign.judge import Count
from chute_ros.errors import RecordError
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.transport.regular_file import open_regular
from chute_ros.transport.shared_folder import shared_folder

#: Rises when what is written means something else.
FORMAT = 1
#: Of the package: what becomes of a flight hangs on all but these.
_NOT_FLYING = ("ros", "tools")


def parts_that_fly(profiles: Path) -> dict[str, str]:
    """A sum of each part that decides what becomes of a flight: the code, the profiles, the wires'
    data types."""
    package = Path(chute_ros.__file__).parent
    modules = package.rglob("*.py")
    shared = [shared_folder(one, "the wires' data types").rglob("*") for one in ("dsdl", "telem")]
    return {
        "code": _sum(
            one for one in modules if one.relative_to(package).parts[0] not in _NOT_FLYING
        ),
        "profiles": _sum(profiles.glob("*.yaml")),
        "data types": _sum([Path(dialect.__file__), *shared[0], *shared[1]]),
    }


def code_that_flies(profiles: Path, *more: Path) -> str:
    """A sum of all these parts, and of more files: flights of two sums cannot be counted
    together."""
    total = hashlib.sha256()
    for part in (*parts_that_fly(profiles).values(), *([_sum(more)] if more else [])):
        total.update(bytes.fromhex(part))
    return total.hexdigest()


def _sum(files: Iterable[Path]) -> str:
    total = hashlib.sha256()
    for file in sorted(files, key=lambda one: (one.name, str(one))):
        if file.is_file():
            with open_regular(file) as opened:
                total.update(hashlib.sha256(opened.read()).digest())
    return total.hexdigest()


def text_of(tally: Tally, seed: int, code: str) -> str:
    """As JSON. seed: of the first flight; code: what flew."""
    values = {
        "format": FORMAT,
        "code": code,
        "seed": seed,
        "flights": tally.flights,
        "took": tally.took,
        "counts": {count.name: n for count, n in tally.counts.items()},
        "reasons": tally.reasons,
        "faults": tally.faults,
        "powerless": [[second, count.name, n] for (second, count), n in tally.powerless.items()],
        "by_body": [
            [body, faulty, count.name, n] for (body, faulty, count), n in tally.by_body.items()
        ],
        "by_vehicle": [
            [vehicle, profile, count.name, n]
            for (vehicle, profile, count), n in tally.by_vehicle.items()
        ],
        "wrong": [_written(line) for line in tally.wrong],
        "lines": [_written(line) for line in tally.lines],
    }
    return json.dumps(values) + "\n"


def tally_of(text: str, seed: int, code: str, named: str) -> Tally:
    """The tally again. RecordError, with the file's name: it is none, or one of other flights."""
    try:
        values = json.loads(text)
        found = {"format": values["format"], "seed": values["seed"], "code": values["code"]}
        for what, wanted in (("format", FORMAT), ("seed", seed), ("code", code)):
            if found[what] != wanted:
                raise RecordError(
                    f"{named} was kept with {what} {found[what]}, this campaign has {wanted}: "
                    "name another file, or remove it"
                )
        return Tally(
            flights=int(values["flights"]),
            took=float(values["took"]),
            counts=Counter({Count[name]: n for name, n in values["counts"].items()}),
            reasons=Counter(values["reasons"]),
            faults=Counter(values["faults"]),
            powerless=Counter(
                {(second, Count[name]): n for second, name, n in values["powerless"]}
            ),
            by_body=Counter(
                {(body, faulty, Count[name]): n for body, faulty, name, n in values["by_body"]}
            ),
            by_vehicle=Counter(
                {
                    (vehicle, profile, Count[name]): n
                    for vehicle, profile, name, n in values["by_vehicle"]
                }
            ),
            wrong=[_read(line) for line in values["wrong"]],
            lines=[_read(line) for line in values["lines"]],
        )
    except (KeyError, TypeError, ValueError) as error:
        kind = type(error).__name__
        raise RecordError(f"{named} is no kept campaign: {kind}: {error}") from None


def _written(line: FlightSummary) -> list[Any]:
    return [one.name if isinstance(one, Count) else one for one in astuple(line)]


def _read(values: list[Any]) -> FlightSummary:
    told = dict(zip((one.name for one in fields(FlightSummary)), values, strict=True))
    return FlightSummary(
        **{**told, "count": Count[told["count"]], "faults": tuple(told["faults"])}
    )
