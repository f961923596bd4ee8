"""What many flights would take, from the rate of a few."""

from __future__ import annotations

from chute_ros.tools.pages import table

#: For which a line of the plan tells.
_CORES = (1, 4, 16, 64, 256, 1024)


def plan(flights: int, rate: float, measured: int, price: float | None) -> str:
    """As a table. rate: flights a second of one core, in the mean of so many measured; price: of a
    core for an hour, in any currency; None: unknown, and so are the costs."""
    core_hours = flights / rate / 3600.0
    head = ["workers, one a core", "hours", "core hours"]
    if price is not None:
        head.append(f"cost at {price:g} a core hour")
    rows = []
    for cores in _CORES:
        row = [str(cores), f"{core_hours / cores:.1f}", f"{core_hours:.0f}"]
        if price is not None:
            row.append(f"{core_hours * price:.2f}")
        rows.append(row)
    return (
        f"{flights} flights, if each core flies {rate * 60.0:.0f} a minute, as in the {measured} "
        f"flights of this run:\n\n{table(head, rows)}"
    )
