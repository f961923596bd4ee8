"""The clauses of the UPF document, and how each is tried on a controller."""

from chute_ros.links.upf.conformance import flying, standard

CLAUSES = (*standard.CLAUSES, *flying.CLAUSES)
