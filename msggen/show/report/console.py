"""The console of rich that the formats for people draw on."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console


@contextmanager
def captured(width: int, *, colour: bool) -> Iterator[tuple[Console, list[str]]]:
    """Yield a console with so many columns, and the lines that it has printed at the end, without spaces after them."""
    console = Console(
        file=io.StringIO(),
        width=width,
        color_system="standard" if colour else None,
        force_terminal=colour,
        no_color=not colour,
        force_jupyter=False,
        legacy_windows=False,
        highlight=False,
        _environ={},
    )
    rows: list[str] = []
    with console.capture() as capture:
        yield console, rows
    text = "\n".join(row.rstrip() for row in capture.get().split("\n"))
    rows += text.rstrip("\n").split("\n")
