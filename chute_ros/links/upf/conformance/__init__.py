"""The clauses of the UPF document, and how each is tried on a controller."""

from chute_ros.links.upf.conformance import flying, node_id, standard, wire

CLAUSES = (*standard.CLAUSES, *wire.CLAUSES, *node_id.CLAUSES, *flying.CLAUSES)
