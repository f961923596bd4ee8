"""A height over time, drawn with characters."""

from __future__ import annotations

#: A moment, s, and the letter that stands for it.
Mark = tuple[float, str]


def chart(
    points: list[tuple[float, float]], marks: list[Mark], width: int, rows: int
) -> list[str]:
    """Lines of a chart of points (s, m), with marks below the axis."""
    start, end = points[0][0], points[-1][0]
    span = max(end - start, 1e-9)
    top = max(height for _, height in points) or 1.0

    def column(when: float) -> int:
        return min(width - 1, max(0, int((when - start) / span * width)))

    grid = [[" "] * width for _ in range(rows)]
    for when, height in points:
        row = min(rows - 1, int(height / top * (rows - 1) + 0.5))
        grid[rows - 1 - row][column(when)] = "*"
    below = [" "] * width
    for when, letter in marks:
        at = column(when)
        while at < width - 1 and below[at] != " ":
            at += 1
        below[at] = letter
    labels = [f"{top * (rows - 1 - row) / (rows - 1):5.0f} m |" for row in range(rows)]
    lines = [label + "".join(cells).rstrip() for label, cells in zip(labels, grid, strict=True)]
    lines.append("        +" + "-" * width)
    lines.append("         " + "".join(below).rstrip())
    return lines
