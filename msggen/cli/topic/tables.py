"""Tables of `msggen topic`, and numbers as JSON has them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from msggen.diagnostics import printable


def print_table(heads: Sequence[str], rows: Sequence[Sequence[str]], right: int) -> None:
    """Print rows under their heads, without empty columns. The last `right` columns are aligned at the right.

    Cells are made `printable`, so that the columns stay aligned.
    """
    if not rows:
        return
    rows = [tuple(map(printable, row)) for row in rows]
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


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None for NaN."""
    return None if math.isnan(value) else value
