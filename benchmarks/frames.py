"""Time per value of the conversions of `frames`: in a batch, and one by one.

    python benchmarks/frames.py

The batches are arrays of 10,000 and of a million values. Vectors of float32 are those of a decoded batch of
SensorCombined, whose values lie apart. The figures are the best of several rounds.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from timeit import repeat
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "generated"))
px4_types: Any = importlib.import_module("px4_types")
frames: Any = px4_types.frames

SMALL, LARGE, ROUNDS = 10_000, 1_000_000, 7
RANDOM = np.random.default_rng(14)


def nanoseconds(convert: Callable[[Any], Any], values: Any, count: int) -> float:
    """Return the time in ns for each of `count` values that one call converts."""
    times = max(1, 20_000 // count)
    return min(repeat(lambda: convert(values), number=times, repeat=ROUNDS)) / times / count * 1e9


def batches(count: int) -> dict[str, tuple[Callable[[Any], Any], Any]]:
    """Return functions with arrays of `count` values."""
    vectors = RANDOM.normal(size=(count, 3))
    quaternions = RANDOM.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    columns = RANDOM.normal(size=(count, 3, 3))
    samples = np.zeros(count, px4_types.SensorCombined.dtype())
    return {
        "vector, float64": (frames.ned_to_enu, vectors),
        "vector, float32": (frames.ned_to_enu, vectors.astype(np.float32)),
        "gyro_rad of a batch": (frames.frd_to_flu, samples["gyro_rad"]),
        "orientation": (frames.px4_to_ros_orientation, quaternions),
        "heading": (frames.ned_to_enu_heading, vectors[:, 0].copy()),
        "covariance, 3x3": (frames.ned_to_enu_covariance, columns + columns.transpose(0, 2, 1)),
    }


def main() -> None:
    """Measure and print."""
    table = Table("conversion", "10,000: ns", "1,000,000: ns", "one by one: ns")
    small, large = batches(SMALL), batches(LARGE)
    for name, (convert, values) in small.items():
        single = values[0].tolist()
        one = nanoseconds(convert, single, 1)
        row = (nanoseconds(convert, values, SMALL), nanoseconds(*large[name], LARGE), one)
        table.add_row(name, *(f"{each:,.1f}" for each in row))
    message = px4_types.VehicleOdometry(pose_frame=1, velocity_frame=1, q=(1.0, 0.0, 0.0, 0.0))
    table.add_row("to_ros(VehicleOdometry)", "", "", f"{nanoseconds(frames.to_ros, message, 1):,.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
