"""Tables and numbers of `msggen topic`."""

from __future__ import annotations

import math
from collections.abc import Sequence


def print_table(heads: Sequence[str], rows: Sequence[Sequence[str]], right: int) -> None:
    """Print rows under their heads, without empty columns. The last `right` columns are aligned at the right."""
    if not rows:
        return
    kept = [index for index, column in enumerate(zip(*rows, strict=True)) if any(column)]
    right = sum(index >= len(heads) - right for index in kept)
    heads, *rows = [[row[index] for index in kept] for row in (heads, *rows)]
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    first = len(heads) - right
    for row in (heads, *rows):
        cells = [
            cell.ljust(width) if index < first else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())


def number_of_bytes(count: float) -> str:
    """Return a number of bytes for people: `90 B`, `1.3 KB`, with 1000 bytes in a KB, as in ROS 2."""
    for unit, size in (("MB", 1e6), ("KB", 1e3)):
        if count >= size:
            return f"{count / size:.2f} {unit}"
    return f"{count:.0f} B"


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None for NaN."""
    return None if math.isnan(value) else value
