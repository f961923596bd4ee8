"""`chute doctor`: what goes wrong in the field, each finding with its remedy."""

from __future__ import annotations

import os

from chute_ros.plain_text import plain
from chute_ros.ros.middleware import fast_dds
from chute_ros.tools.chute.doctor_computer import (
    disk_finding,
    environment_findings,
    shared_memory_finding,
    version_finding,
    versions,
)
from chute_ros.tools.chute.doctor_ports import port_findings
from chute_ros.tools.chute.errors import CommandError
from chute_ros.tools.chute.finding import WRONG, DoctorFinding, finding_lines, worst_first
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen
from chute_ros.tools.chute.record_text import folder_of
from chute_ros.tools.chute.surroundings import installed_middlewares, surroundings


def main(chosen: Chosen) -> int:
    """Exit code 0: nothing is wrong; 1: something is."""
    around = surroundings(os.environ, installed_middlewares())
    found = [*environment_findings(around), shared_memory_finding(), *port_findings()]
    folder = None
    if not around.mistake():
        try:
            # Here: what it looks for is, among others, whether this can be imported.
            from chute_ros.tools.chute.doctor_ros import vehicle_findings

            of_vehicle, file = vehicle_findings(chosen.namespace, chosen.wait())
            found += of_vehicle
            folder = folder_of(file) if file and folder_of(file).is_dir() else None
        except ImportError as error:
            remedy = "build both packages (`make build`, or `colcon build`) and source the result"
            found.append(DoctorFinding(WRONG, f"cannot be imported: {error}", remedy))
        except CommandError as error:
            found.append(DoctorFinding(WRONG, str(error), "see docs/guide/first_flight.md"))
    of_computer = versions(around, fast_dds())
    found += [disk_finding(folder), version_finding(of_computer)]
    told = worst_first(found)
    well = all(one.level != WRONG for one in told)
    if chosen.json:
        print(
            json_text(
                {
                    "namespace": chosen.namespace,
                    "well": well,
                    "findings": told,
                    "versions": of_computer,
                }
            )
        )
    else:
        print("\n".join(map(plain, finding_lines(told))))
    return DONE if well else NOT_WELL
