"""Runs all measurements in the environment of run.py, prints the tables, and writes the page and its charts."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console

import charts
import tables
from effort import FULL, QUICK
from environment import ROOT
from goals import goals, summary
from page import WIDTH, Section, kept, page
from results import Results, collect

DOCS = ROOT / "docs"
PAGE = DOCS / "benchmarks.md"


def main() -> None:
    """Measure and print. With `--quick`, measure little and write nothing."""
    quick = "--quick" in sys.argv
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    results = collect(QUICK if quick else FULL, console)
    for section in sections(results):
        for table in (*section.tables, *section.details):
            table.show(console)
    short = summary(list(goals(results)))
    files = {DOCS / "benchmarks" / f"{name}.svg": text for name, text in drawn(results).items()}
    files[PAGE] = page(short, sections(results)) + kept(PAGE.read_text(encoding="utf-8"))
    if quick:
        console.print("This quick run only shows that everything works.")
    else:
        short.show(console)
        write(files)
        console.print(f"written: {', '.join(str(path.relative_to(ROOT)) for path in files)}", soft_wrap=True)


def write(files: dict[Path, str]) -> None:
    """Write files from texts by path."""
    for path, text in files.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


def drawn(results: Results) -> dict[str, str]:
    """Return the charts by name."""
    return {
        "codec": charts.codec_chart(results.decode, results.encode),
        "columns": charts.columns_chart(results.columns, results.arrays),
        "cost": charts.cost_chart(results.starts, results.sizes),
        "generation": charts.scale_chart(results.scales),
    }


def sections(results: Results) -> list[Section]:
    """Return the sections of the page."""
    decode = tables.codec_table("decode", results.samples, results.decode)
    encode = tables.codec_table("encode", results.samples, results.encode)
    return [
        Section(
            "Decode and encode",
            [decode],
            "codec",
            "Decode and encode: time compared with msggen, a bar for each package and a dot for each message",
            [encode, tables.lazy_table(results.lazy)],
        ),
        Section(
            "Batches",
            [],
            "columns",
            "Time for each sample from payloads to columns, message by message",
            [tables.columns_table(results.columns), tables.arrays_table(results.arrays, results.bandwidth)],
        ),
        Section(
            "Ready, and memory",
            [],
            "cost",
            "Time until a first message is decoded, and memory of a decoded message, for each package",
            [tables.starts_table(results.starts), tables.memory_table(results.sizes)],
        ),
        Section(
            "Generation",
            [tables.commands_table(results.commands)],
            "generation",
            "Time of generation for each message, for one, ten and a hundred times as many messages",
            [tables.scale_table(results.scales)],
        ),
    ]


if __name__ == "__main__":
    main()
