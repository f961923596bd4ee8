"""`campaign --vehicle`: the heights that the failures of described vehicles need."""

from __future__ import annotations

import shlex
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from chute_ros.campaign.confidence import flights_needed
from chute_ros.campaign.description import read_description
from chute_ros.campaign.heights import WANTED, Campaign, find, own_shipped
from chute_ros.errors import ChuteError, ProfileError
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.tools.heights_page import VehicleHeights, heights, page, times
from chute_ros.tools.heights_picture import picture
from chute_ros.tools.machine import machine
from chute_ros.tools.page_file import MARKDOWN, SVG, require_output, write_page
from chute_ros.tools.progress import Progress

#: Of each failure, where none are asked for: enough for the statement.
FLIGHTS = flights_needed(WANTED)
#: Options of the other campaign, which draws vehicles and faults of its own.
_UNFIT = (
    *("each", "scheduler", "resume", "tapes", "tapes_only", "replay", "plan"),
    *("core_hour_price", "failures"),
)


def refuse_unfit(options: ArgumentParser, chosen: Namespace) -> None:
    """Exit code 2: an option was given that does not fit."""
    if chosen.vehicle is None:
        if chosen.faults:
            options.error(
                "argument --faults: only with --vehicle; without it each flight has its own"
            )
        return
    given = [one for one in _UNFIT if getattr(chosen, one) != options.get_default(one)]
    if given:
        name = given[0].replace("_", "-")
        options.error(
            f"argument --vehicle: not with --{name}: the failures of a described vehicle are "
            "flown on this machine, all in one run, and no other flights"
        )
    if len({one.stem for one in chosen.vehicle}) < len(chosen.vehicle):
        options.error("argument --vehicle: two files have the same name: rename one")


def fly_described(options: ArgumentParser, chosen: Namespace, profiles: Path) -> None:
    """Fly all vehicles, print what was found, and write the page. Exit code 2: a description is
    not right, or something else stands where the page or a picture goes."""
    begun, flights = time.monotonic(), chosen.flights or FLIGHTS
    campaigns, read = [], []
    try:
        for file in chosen.vehicle:
            vehicle = read_description(file, profiles)
            campaigns.append(Campaign(vehicle, profiles, chosen.seed, flights, chosen.faults))
            read.append(_profile(campaigns[-1]))
    except ProfileError as error:
        options.error(f"argument --vehicle: {error}")
    try:
        if chosen.page:
            require_output(chosen.page, MARKDOWN, chosen.vehicle)
            for file in chosen.vehicle:
                require_output(_picture(chosen.page, file), SVG)
    except ChuteError as error:
        options.error(f"argument --page: {error}")
    results = []
    for file, campaign, profile in zip(chosen.vehicle, campaigns, read, strict=True):
        progress = Progress(f"{campaign.vehicle.name}: flights", campaign.number)
        every = find(campaign, chosen.jobs, progress.at)
        drawn = _picture(chosen.page, file).name if chosen.page else ""
        results.append(VehicleHeights(file, campaign, every, profile, drawn))
        print(f"{campaign.vehicle.name}, {flights} flights of each failure:\n")
        print(f"{heights(every)}\n\n{times(results[-1].plain)}\n", flush=True)
    if chosen.page:
        took = f"{time.monotonic() - begun:.0f} s, {chosen.jobs} at a time on {machine()}"
        _write(results, chosen.page, _command(chosen, flights), took)


def _picture(page: Path, vehicle: Path) -> Path:
    """Beside the page, of the vehicle of this file."""
    return page.with_name(f"{page.stem}.{vehicle.stem}.svg")


def _profile(campaign: Campaign) -> Profile:
    """ProfileError: it is not right."""
    vehicle = campaign.vehicle
    shipped = own_shipped(campaign.folder, vehicle.profile)
    return shipped.config(vehicle.parachute, vehicle.kind, False, 0).profile


def _write(results: Sequence[VehicleHeights], path: Path, command: str, how: str) -> None:
    for one in results:
        allows = one.profile.below_minimum is BelowMinimum.DEPLOY
        lowest = 0.0 if allows else one.profile.minimum_height
        write_page(path.with_name(one.picture), picture(one.plain, lowest), SVG)
    write_page(path, page(results, command, how), MARKDOWN, [one.file for one in results])


def _command(chosen: Namespace, flights: int) -> str:
    """By which the same page is written again."""
    more = ["--faults", str(chosen.faults)] if chosen.faults else []
    files = [str(one) for one in chosen.vehicle]
    words = ["campaign", "--vehicle", *files, "--flights", str(flights), *more]
    return shlex.join([*words, "--seed", str(chosen.seed), "--page", str(chosen.page)])
