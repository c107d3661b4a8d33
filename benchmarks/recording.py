"""Measure `msggen record`: CPU time of a sample from the socket to the file, and whether all of them are in the file.

    python benchmarks/recording.py            half a minute; docs/recordings.md shows the table
    python benchmarks/recording.py --quick    checks in a few seconds that it works

The sender is another process on this computer. CPU time is that of the recording process, with its part of the kernel.
Needs the packages of the extra `test`.
"""

from __future__ import annotations

import argparse
import importlib
import os
import tempfile
import time
from typing import Any

from mcap.reader import make_reader

from link import SETTLE, send, sender
from link_sender import Load
from msggen.exports.recorder import Recorder
from msggen.exports.writer import Channel
from msggen.link.link import Route
from msggen.link.udp import UdpLink
from msggen.live import Vehicle
from tables import Table

HEAD = ["samples", "sent", "in the file", "lost by the link", "dropped", "MB", "CPU, us a sample", "CPU, % of a core"]


def measure(topics: int, hz: float, seconds: float, compression: str) -> list[str]:
    """Record what a sender sends, and return the cells of a row. Without a compression, samples are only watched."""
    package: Any = importlib.import_module("px4_types")

    def describe(route: Route) -> Channel:
        info = package.by_type(route.ros_type).__msg__
        return Channel(route.name, route.ros_type, info.definition, info.type_hash)

    def watch(*_: object) -> None:
        watched.append(None)

    watched: list[None] = []
    link = UdpLink(port=0)
    with tempfile.TemporaryDirectory() as folder, Vehicle(link, package) as vehicle:
        load = Load("udp", link.port, 1, topics, topics * hz, seconds)
        path = os.path.join(folder, "flight.mcap")
        recorder = Recorder(path, describe, compression=compression or "none")
        with sender(load) as process:
            vehicle.wait_connected(30)
            vehicle.watch(recorder.take if compression else watch)
            time.sleep(SETTLE)
            before = time.process_time()
            sent = send(process)
            recorder.close()
            cpu = time.process_time() - before
        name = f"{topics} topic{'s' * (topics > 1)} at {hz:,.0f} Hz, {compression or 'only received'}"
        found, size = (in_file(path), os.path.getsize(path) / 1e6) if compression else (len(watched), 0.0)
        dropped = recorder.counts().dropped
        cells = [f"{found:,}", f"{vehicle.statistics.lost:,}", f"{dropped:,}", f"{size:.1f}" if compression else ""]
        return [name, f"{sent:,}", *cells, f"{cpu / sent * 1e6:.0f}", f"{cpu / seconds * 100:.0f}"]


def in_file(path: str) -> int:
    """Return the number of samples in a file."""
    with open(path, "rb") as file:
        return sum(1 for _ in make_reader(file).iter_messages(log_time_order=False))


def main() -> None:
    """Measure and print a table, as Markdown if the output is not a terminal."""
    parser = argparse.ArgumentParser(description="Measure recording.")
    parser.add_argument("--quick", action="store_true", help="a second for each measurement")
    seconds = 1.0 if parser.parse_args().quick else 10.0
    rows = [measure(24, 250, seconds, compression) for compression in ("", "none", "lz4", "zstd")]
    rows += [measure(24, 500, seconds, "zstd"), measure(1, 250, seconds, "zstd")]
    Table("recording over UDP", HEAD, rows).print()


if __name__ == "__main__":
    main()
