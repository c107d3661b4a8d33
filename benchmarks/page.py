"""The page docs/benchmarks.md: results, date, machine, versions and method."""

from __future__ import annotations

import io
import os
import platform
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

import msggen
from effort import FULL
from peers import PEERS
from tables import NONE, Table

WIDTH = 180
"""Width of printed tables if the terminal does not have one: the tables have many columns."""

SHOWN = ("SensorCombined", "VehicleLocalPosition", "EscStatus")
"""The messages with a row on the page, if a table has means of more: a small, a large and a nested one."""

KEPT = "Simulated vehicles"
"""The last section, which is of simulated.py."""

RATIOS = """\
A ratio is the time of another package divided by the time of msggen, unless the column head says otherwise. Means are
over all messages, of which the charts have a dot each. The terminal prints all rows, and tables of encoding,
lazy views, batches, start-up, memory and larger sets of messages."""

HOW = f"""\
Contestants take turns of about {FULL.turn * 1e3:g} ms, in {FULL.rounds} rounds, and the minimum of each
counts, because other work on a machine can only make a turn longer. The types of all packages are made from the same
definitions, and used as their documentation shows ([peers.py](../benchmarks/peers.py)). Before timing, decoded values
are compared with msggen's, and encoded bytes with the firmware's. The reason for a {NONE} is below the table.

The unpack floor is only `unpack_from` of `struct` with the message's own format, and for encoding only `pack`. The
loops that fill columns fill numpy arrays created in advance, one for each field, sample by sample."""


class Section(NamedTuple):
    """A part of the page: a chart, if there is one, and tables."""

    title: str
    tables: Sequence[Table]
    chart: str = ""
    """The name of its file, without the suffix."""
    says: str = ""
    """The alternative text of the chart."""
    details: Sequence[Table] = ()
    """Further tables, which only the terminal prints."""


def page(summary: Table, sections: Sequence[Section]) -> str:
    """Return the page as Markdown."""
    versions = ", ".join([f"msggen {msggen.__version__}", *(f"{peer.name} {peer.version() or NONE}" for peer in PEERS)])
    today = datetime.now(timezone.utc).date()
    parts = [
        "# Benchmarks",
        f"```console\n$ python benchmarks/run.py\n...\n{printed(summary)}\n```",
        "This sets up all packages in an environment of their own, measures for some minutes, and writes this page.",
        f"Last run: {today}, on {machine()}, with {versions}.",
        RATIOS,
    ]
    for section in sections:
        parts.append(f"## {section.title}")
        if section.chart:
            parts.append(f"![{section.says}](benchmarks/{section.chart}.svg)")
        for table in section.tables:
            parts += [f"{table.title[:1].upper()}{table.title[1:]}:", _short(table).markdown()]
    return "\n\n".join([*parts, "## How it was measured", HOW]) + "\n"


def _short(table: Table) -> Table:
    rows = [row for row in table.rows if row[0] in SHOWN]
    return table._replace(rows=rows) if table.means else table


def kept(text: str) -> str:
    """Return the part of a page that simulated.py writes, "" if there is none."""
    return "".join(text.partition(f"\n## {KEPT}\n")[1:])


def printed(table: Table) -> str:
    """Return a table as the terminal shows it."""
    stream = io.StringIO()
    table.show(Console(file=stream, width=WIDTH, color_system=None))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip("\n")


def machine() -> str:
    """Return processor, cores and Python."""
    return f"{processor()} with {os.cpu_count()} cores, {platform.python_implementation()} {platform.python_version()}"


def processor() -> str:
    """Return the name of the processor: from Linux if possible, otherwise from Python."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
