"""All measurements, in one value."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

import codec
import columns
import generation
import imports
import memory
from effort import Effort
from messages import Sample, read_samples


class Results(NamedTuple):
    """The results."""

    samples: Sequence[Sample]
    decode: codec.Speeds
    encode: codec.Speeds
    lazy: codec.Times
    columns: codec.Speeds
    arrays: codec.Times
    bandwidth: float
    starts: imports.Starts
    sizes: memory.Sizes
    commands: Mapping[str, float]
    scales: Sequence[generation.Scale]


def collect(effort: Effort, console: Console) -> Results:
    """Measure everything, and show the progress on the console."""
    samples = read_samples(effort.messages)
    with console.status("comparing results; on a first run, cydr compiles") as status:
        entries = codec.enter_all(samples)
        status.update("decode and encode")
        decode = codec.measure(entries, "decode", effort)
        encode = codec.measure(entries, "encode", effort)
        lazy = columns.measure_lazy(entries, effort)
        status.update("batches")
        by_column = columns.measure_columns(samples, entries, effort)
        arrays = columns.measure_arrays(samples, entries, effort)
        bandwidth = columns.copy_bandwidth(effort)
        status.update("memory")
        sizes = memory.measure(samples, entries, effort)
        status.update("imports")
        starts = imports.measure(samples[0], entries, effort)
        status.update("generation")
        with tempfile.TemporaryDirectory() as folder:
            commands = generation.measure_commands(Path(folder), effort)
            scales = generation.measure_scale(Path(folder), samples[0].catalog, effort)
    return Results(samples, decode, encode, lazy, by_column, arrays, bandwidth, starts, sizes, commands, scales)
