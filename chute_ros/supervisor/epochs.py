"""The numbers of supervisors' terms: each takeover has a higher one, and no two share one.

A supervisor of rank r uses only epochs that leave r when divided by RANKS, so that two that take
over in the same moment, each unseen by the other, never decide under the same number: a device
node would take the second's decision for a repetition of the first's.
"""

from __future__ import annotations

#: Supervisors that one vehicle may have.
RANKS = 4
LARGEST_EPOCH = 2**32 - 1


def epoch_above(seen: int, rank: int) -> int:
    """The smallest epoch of this rank that is above seen; above LARGEST_EPOCH: none is left."""
    return seen + 1 + (rank - seen - 1) % RANKS
