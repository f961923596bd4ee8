"""`chute parameters`: the parameters of the nodes, and which differ from their defaults."""

from __future__ import annotations

import sys

from chute_ros.tools.chute.gathering import expected
from chute_ros.tools.chute.hearing import ReceivedMessages
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.node_parameters import nodes, parameters_of_node
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen
from chute_ros.tools.chute.parameter_list import Given, defaults_for, given, parameter_lines
from chute_ros.tools.chute.session import ChuteSession, opened


def main(chosen: Chosen) -> int:
    """Exit code 0: shown; 1: a node did not answer, or none is there."""
    within = chosen.wait()
    told: dict[str, list[Given]] = {}
    silent: list[str] = []
    with opened(chosen.namespace) as session:
        listening = Listening(session)
        found = nodes(session, chosen.more.node, within)
        if not found:
            what = f"node {chosen.more.node}" if chosen.more.node else "node that sends heartbeats"
            raise session.not_heard(f"no {what} is found", within)
        if chosen.more.node is None:
            # One that hangs, or is not there, is found by what the supervisor says of it alone.
            session.until(lambda: _all_found(session, listening.picture), within)
            found = session.links()
            silent = sorted(expected(listening.picture) - {*found})
            if not listening.picture.states:
                silent.append("a supervisor")
        for node in found:
            values = parameters_of_node(session, node, within)
            if values is None:
                silent.append(node)
            else:
                every = given(values, defaults_for(node, values))
                told[node] = [one for one in every if one.differs or not chosen.more.changed]
    for node in silent:
        print(f"chute: {node} did not answer within {within:g} s", file=sys.stderr)
    if chosen.json:
        print(json_text({"namespace": chosen.namespace, "nodes": told, "silent": silent}))
    else:
        for node, parameters in told.items():
            print("\n".join(parameter_lines(node, parameters)))
    return NOT_WELL if silent else DONE


def _all_found(session: ChuteSession, picture: ReceivedMessages) -> bool:
    """Every node that the vehicle should have."""
    return bool(picture.states) and expected(picture) <= {*session.links()}
