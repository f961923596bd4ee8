"""The clauses of the UPF document, and how each is tried on a controller or a trigger."""

from dataclasses import replace

from chute_ros.links.upf.conformance import flying, node_id, standard, trigger, wire
from chute_ros.links.upf.conformance.bench import TRIGGER

_CONTROLLER = (*standard.CLAUSES, *wire.CLAUSES, *node_id.CLAUSES, *flying.CLAUSES)
CLAUSES = (*(replace(one, without=TRIGGER) for one in _CONTROLLER), *trigger.CLAUSES)
