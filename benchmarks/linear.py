"""Time and memory of every parser and reader for inputs of 10 kB to 10 MB, drawn as docs/benchmarks/linear.svg.

    python benchmarks/linear.py          measures for about 20 minutes, prints a table and draws the chart
    python benchmarks/linear.py --quick  measures up to 100 kB and draws nothing

An input is not made larger if the next size is expected to take more than `PATIENCE` seconds. The chart needs
matplotlib, from the environment of the other benchmarks.
"""

from __future__ import annotations

import argparse
import sys
import tracemalloc
from collections.abc import Mapping, Sequence
from math import log
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from worst_inputs import READERS, Reader

CHART = Path(__file__).resolve().parent.parent / "docs" / "benchmarks" / "linear.svg"
SIZES = (10**4, 3 * 10**4, 10**5, 3 * 10**5, 10**6, 3 * 10**6, 10**7)
PATIENCE = 90
TRACED = 10**5
"""The largest size for which memory is measured, because tracing slows a reader down."""

SHORTEST = 0.001
"""The time in seconds from which times are compared."""

STEEPEST = 1.5
"""The power of the size from which a reader counts as not linear: between 1, and 2 for quadratic time."""


class Cost(NamedTuple):
    """The slowest of the worst inputs of one size: its size in bytes, seconds, and peak of memory in bytes."""

    size: int
    seconds: float
    peak: int


def costs(reader: Reader, sizes: Sequence[int]) -> list[Cost]:
    """Return the costs of a reader for each size, up to one that is expected to take longer than `PATIENCE`."""
    found: list[Cost] = []
    for size in sizes:
        if found and found[-1].seconds * size / found[-1].size > PATIENCE:
            break
        each = [cost(reader, kind, size) for kind in reader.inputs]
        found.append(Cost(size, max(one.seconds for one in each), max(one.peak for one in each)))
    return found


def cost(reader: Reader, kind: str, size: int) -> Cost:
    """Return the cost of one input."""
    data = reader.inputs[kind](size)
    start = perf_counter()
    reader.read(data)
    seconds = perf_counter() - start
    if size > TRACED:
        return Cost(size, seconds, 0)
    tracemalloc.start()
    reader.read(data)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return Cost(size, seconds, peak)


def exponent(found: Sequence[Cost]) -> float:
    """Return the power of the size by which the time grows between the first size of 1 ms and the last one."""
    timed = [one for one in found if one.seconds >= SHORTEST]
    if timed[:1] == timed[-1:]:
        return 0.0
    return log(timed[-1].seconds / timed[0].seconds) / log(timed[-1].size / timed[0].size)


def draw(measured: Mapping[str, Sequence[Cost]]) -> None:
    """Draw time and memory by size, a line for each reader."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "msggen", "figure.facecolor": "white"})
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    for panel, title in zip(panels, ("time in s", "peak of memory in bytes"), strict=True):
        panel.set(title=f"Worst inputs: {title}", xlabel="bytes of input", xscale="log", yscale="log")
        panel.grid(visible=True, alpha=0.3)
    for number, (name, found) in enumerate(measured.items()):
        style = {"color": f"C{number % 10}", "linestyle": ("-", "--", ":")[number // 10], "marker": "."}
        panels[0].plot([one.size for one in found], [one.seconds for one in found], label=name, **style)
        traced = [one for one in found if one.peak]
        panels[1].plot([one.size for one in traced], [one.peak for one in traced], **style)
    panels[0].plot([10**4, 10**7], [10**-3, 1], color="black", linewidth=3, alpha=0.3, label="linear")
    panels[1].plot([10**4, TRACED], [10**5, 10**6], color="black", linewidth=3, alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=8)
    figure.savefig(CHART, metadata={"Date": None})


def main() -> int:
    """Measure all readers, print a table and draw the chart. Return 1 if one of them is not linear."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="up to 100 kB; draws nothing")
    options = parser.parse_args()
    measured: dict[str, list[Cost]] = {}
    print(f"{'reader':20} {'largest':>10} {'seconds':>9} {'us/byte':>9} {'memory/byte':>12} {'exponent':>9}")
    for name, reader in READERS.items():
        found = measured[name] = costs(reader, SIZES[:3] if options.quick else SIZES)
        last = found[-1]
        memory = max(one.peak / one.size for one in found)
        print(
            f"{name:20} {last.size:10,} {last.seconds:9.3f} {last.seconds / last.size * 1e6:9.3f} {memory:12.1f} "
            f"{exponent(found):9.2f}",
            flush=True,
        )
    if not options.quick:
        draw(measured)
    return int(any(exponent(found) > STEEPEST for found in measured.values()))


if __name__ == "__main__":
    sys.exit(main())
