"""Measure how long recordings take to read, side by side with other libraries.

    python benchmarks/run.py recordings            about three minutes;  docs/reading.md shows the tables
    python benchmarks/run.py recordings --quick    checks in a few seconds that it works
    python benchmarks/recordings.py --ulog FILE    reads this ULog, too, beside generated ones: CPU times and goals

The recordings have 18 topics at their real rates for 600 s: MCAP with each compression, a database of rosbag2, and a
ULog. The floor only reads an MCAP file and decompresses its chunks. msggen gives arrays of all samples; the other
libraries give a message of Python at a time, which is not yet a column, except that pyulog gives columns. Times are
elapsed, the best of some turns in one process; of the slow libraries, the first turn. The CPU time is longer where a
thread decompresses ahead. A library that is not installed is named below the table, and so is the load of the machine.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from examined import findings_table, pool_table, write_flight_log
from flight import COMPRESSIONS, Topic, beginning, flight, write_db3, write_mcap, write_ulog
from msggen import recordings
from msggen.recordings.files.compression import decompress_into
from tables import NONE, Table
from ulogs import first_table, ulog_table, write_vehicle_log

SECONDS = 600
MCAP_HEAD = ["reader of MCAP", *(f"{each}, ms" for each in COMPRESSIONS), *(f"{each}, CPU ms" for each in COMPRESSIONS)]
OTHERS_HEAD = ["reader", "db3, ms", "ULog, ms"]


def floor(path: str) -> None:
    """Read a file and decompress its chunks."""
    data = Path(path).read_bytes()
    for kind, start, size, whole in _chunks(path):
        target = memoryview(bytearray(whole)) if kind else memoryview(b"")
        if kind:
            decompress_into(kind, data[start : start + size], target)


_known: dict[str, list[tuple[str, int, int, int]]] = {}


def _chunks(path: str) -> list[tuple[str, int, int, int]]:
    """Return compression, offset, size and size without compression of each chunk."""
    if path not in _known:
        from mcap.reader import make_reader

        with open(path, "rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None  # noqa: S101 - the file was ended
        _known[path] = [
            (each.compression, each.chunk_start_offset + 9 + 28 + 4 + len(each.compression) + 8, *_sizes(each))
            for each in summary.chunk_indexes
        ]
    return _known[path]


def _sizes(index: Any) -> tuple[int, int]:
    return index.compressed_size, index.uncompressed_size


def ours(path: str, *, verify: bool = True) -> None:
    """Read all topics as structured arrays."""
    with recordings.open(path, verify=verify) as log:
        log.load()


def our_columns(path: str) -> None:
    """Read all topics as columns."""
    with recordings.open(path) as log:
        for samples in log.load().values():
            samples.columns()


def tables(path: str) -> None:
    """Read one topic after the other as a table."""
    with recordings.open(path) as log:
        for key in log.keys():  # noqa: SIM118 - as programs are written
            log.table(key)


def summary(path: str) -> None:
    """Read what `msggen log info` shows of a large file."""
    with recordings.open(path) as log:
        _ = [(topic.count, topic.rate, topic.first, topic.last) for topic in log.topics]


def checksums(path: str) -> None:
    """Compare the chunks with their checksums."""
    with recordings.open(path) as log:
        log.verify()


def one_topic(path: str, *, verify: bool = True) -> None:
    """Read a topic."""
    with recordings.open(path, verify=verify) as log:
        log.samples("VehicleOdometry")


def ten_seconds(path: str) -> None:
    """Read ten seconds of a topic."""
    with recordings.open(path) as log:
        middle = log.duration / 2
        log.samples("VehicleOdometry", start=middle, stop=middle + 10)


def rosbags(path: str) -> None:
    """Decode all messages with rosbags."""
    from rosbags.highlevel import AnyReader

    with AnyReader([Path(path)]) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def mcap_ros2(path: str) -> None:
    """Decode all messages with mcap-ros2-support."""
    from mcap_ros2.reader import read_ros2_messages

    _exhaust(read_ros2_messages(path))


def mcap_ros2_fast(path: str) -> None:
    """Decode all messages with mcap-ros2-support-fast, and small-mcap, as its documentation shows."""
    reader: Any = importlib.import_module("small_mcap")
    module: Any = importlib.import_module("mcap_ros2_support_fast")
    with open(path, "rb") as file:
        for message in reader.read_message_decoded(file, decoder_factories=[module.DecoderFactory()]):
            _ = message.decoded_message  # decodes it


def pybag(path: str) -> None:
    """Decode all messages with pybag-sdk."""
    module: Any = importlib.import_module("pybag.mcap_reader")
    logging.getLogger("pybag").setLevel(logging.ERROR)  # it tells that topics overlap
    reader = module.McapFileReader.from_file(path)
    _exhaust(reader.messages(list(reader.get_topics())))
    reader.close()


def _exhaust(messages: Iterator[Any] | Any) -> None:
    for _ in messages:
        pass


def pyulog(path: str) -> None:
    """Read all columns with pyulog."""
    module: Any = importlib.import_module("pyulog")
    module.ULog(path)


Readers = dict[str, tuple[Callable[[str], None], bool]]
"""Readers, and whether they are so fast that they take many turns."""
FLOOR = "floor: read and decompress"
ON_MCAP: Readers = {
    FLOOR: (floor, True),
    "msggen, structured arrays": (ours, True),
    "msggen, the same without checksums": (partial(ours, verify=False), True),
    "msggen, columns": (our_columns, True),
    "msggen, tables in a loop over the topics": (tables, True),
    "msggen, one topic": (one_topic, True),
    "msggen, one topic without checksums": (partial(one_topic, verify=False), True),
    "msggen, 10 s of one topic": (ten_seconds, True),
    "msggen, counts and times of topics": (summary, True),
    "msggen, `verify` alone": (checksums, True),
    "rosbags, messages": (rosbags, False),
    "mcap-ros2-support, messages": (mcap_ros2, False),
    "mcap-ros2-support-fast, messages": (mcap_ros2_fast, False),
    "pybag-sdk, messages": (pybag, False),
}
ON_DB3: Readers = {
    "msggen, structured arrays": (ours, True),
    "msggen, columns": (our_columns, True),
    "msggen, one topic": (one_topic, True),
    "rosbags, messages": (rosbags, False),
}
ON_ULOG: Readers = {
    "msggen, structured arrays": (ours, True),
    "msggen, columns": (our_columns, True),
    "msggen, one topic": (one_topic, True),
    "pyulog, columns": (pyulog, False),
}

OTHERS = {"db3": (write_db3, ON_DB3), "ulg": (write_ulog, ON_ULOG)}
"""The other formats by the ends of their names: what writes them, and what reads them."""


class Taken(NamedTuple):
    """The shortest times of a reader for a file, in s."""

    elapsed: float
    cpu: float


Best = dict[tuple[str, str], Taken]
"""The times of each reader and file."""


def seconds_of(readers: Readers, paths: dict[str, str], small: str, rounds: int) -> Best:
    """Return the times of readers, which take turns. Each reads a small file first: imports do not count."""
    for read, _ in readers.values():
        with suppress(ModuleNotFoundError):
            read(small)
    best: Best = {}
    for number in range(rounds):
        for name, (read, is_fast) in readers.items():
            if number and not is_fast:
                continue
            for label, path in paths.items():
                with suppress(ModuleNotFoundError):
                    before, cpu_before = time.perf_counter(), time.process_time()
                    read(path)
                    taken = Taken(time.perf_counter() - before, time.process_time() - cpu_before)
                    best[name, label] = Taken(*map(min, taken, best.get((name, label), taken)))
    return best


def peak_memory(path: str) -> tuple[float, float]:
    """Return the memory that loading a file takes at most, and that of the arrays, in MB."""
    program = (
        "import sys, tracemalloc\nfrom msggen import recordings\n"
        "with recordings.open(sys.argv[1]) as log: log.topics\n"
        "tracemalloc.start()\n"
        "with recordings.open(sys.argv[1]) as log: loaded = log.load()\n"
        "size = sum(each.array.nbytes + 2 * each.log_times.nbytes for each in loaded.values())\n"
        "print(tracemalloc.get_traced_memory()[1], size)\n"
    )
    found = subprocess.run([sys.executable, "-c", program, path], check=True, capture_output=True, text=True)
    peak, size = map(int, found.stdout.split())
    return peak / 1e6, size / 1e6


def _milliseconds(best: Best, reader: str, labels: Iterable[str]) -> list[list[str]]:
    """Return the elapsed times and the CPU times of a reader."""
    times = [best.get((reader, label)) for label in labels]
    return [
        [NONE if each is None else f"{each[which] * 1e3:,.1f}" for each in times] for which in range(len(Taken._fields))
    ]


def _load() -> str:
    """Return how busy the machine is, on systems that tell it."""
    told = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return f"load of the machine at the end: {told}, with {os.cpu_count()} processors"


def _missing(readers: Iterable[str], best: Best) -> list[str]:
    """Return notes on the libraries that are not installed."""
    present = {name for name, _ in best}
    return [f"{name.partition(',')[0]} is not installed" for name in readers if name not in present]


def mcap_table(folder: str, topics: list[Topic], rounds: int, readers: Readers = ON_MCAP) -> Table:
    """Measure reading of MCAP files."""
    paths = {compression: f"{folder}/{compression}.mcap" for compression in COMPRESSIONS}
    for compression, path in paths.items():
        write_mcap(path, topics, compression)
    small = f"{folder}/small.mcap"
    write_mcap(small, beginning(topics), "zstd")
    best = seconds_of(readers, paths, small, rounds)
    peak, size = peak_memory(paths["zstd"])
    whole = sum(each[3] for each in _chunks(paths["zstd"])) / 1e6
    rows = [
        [name, *chain.from_iterable(_milliseconds(best, name, paths))] for name in readers if (name, "zstd") in best
    ]
    notes = [
        _load(),
        f"memory: {peak:.0f} MB at most for {size:.0f} MB of arrays; the chunks have {whole:.0f} MB",
        *_missing(readers, best),
    ]
    return Table(f"MCAP, {sum(len(topic.times) for topic in topics):,} samples", MCAP_HEAD, rows, notes=notes)


def others_table(folder: str, topics: list[Topic], rounds: int) -> Table:
    """Measure reading of the other formats."""
    paths = {kind: f"{folder}/flight.{kind}" for kind in OTHERS}
    best: Best = {}
    for kind, (write, readers) in OTHERS.items():
        small = f"{folder}/small.{kind}"
        write(small, beginning(topics))
        write(paths[kind], topics)
        best |= seconds_of(readers, {kind: paths[kind]}, small, rounds)
    present = {name for name, _ in best}
    rows = [[name, *_milliseconds(best, name, paths)[0]] for name in ON_DB3 | ON_ULOG if name in present]
    sizes = ", ".join(f"{Path(path).suffix[1:]} {Path(path).stat().st_size / 1e6:.0f} MB" for path in paths.values())
    return Table(
        "other formats", OTHERS_HEAD, rows, notes=[_load(), f"the files: {sizes}", *_missing(ON_DB3 | ON_ULOG, best)]
    )


SAMPLES = {"generated, few samples": 5_000, "generated, some samples": 15_000, "generated, more samples": 60_000}
"""The generated logs of a vehicle, and the samples of all their topics."""


def vehicle_tables(folder: str, given: list[str], rounds: int, *, is_quick: bool) -> Iterator[Table]:
    """Measure reading and findings of ULogs with many topics: generated ones and those that were given."""
    paths = {name: f"{folder}/{count}.ulg" for name, count in SAMPLES.items()}
    for name, path in paths.items():
        write_vehicle_log(path, SAMPLES[name])
    paths |= {Path(path).name: path for path in given}
    yield ulog_table(paths, ours, our_columns, pyulog, rounds)
    yield first_table(paths, 2 * rounds)
    flown = f"{folder}/flight.ulg"
    write_flight_log(flown)
    yield findings_table({"simulated flight": flown, **paths}, rounds)
    if not given:
        yield pool_table(folder, flown, (10, 40) if is_quick else (100, 1000))


def main() -> None:
    """Measure and print tables, as Markdown if the output is not a terminal."""
    parser = argparse.ArgumentParser(description="Measure reading of recordings.")
    parser.add_argument("--quick", action="store_true", help="recordings of 10 s")
    parser.add_argument("--ulog", metavar="FILE", action="append", default=[], help="read this ULog, and only ULogs")
    options = parser.parse_args()
    is_quick = options.quick
    with tempfile.TemporaryDirectory() as folder:
        for table in vehicle_tables(folder, options.ulog, 3 if is_quick else 9, is_quick=is_quick):
            table.print()
    if options.ulog:
        return
    topics = flight(10 if is_quick else SECONDS)
    for measure in (mcap_table, others_table):
        with tempfile.TemporaryDirectory() as folder:
            measure(folder, topics, 3 if is_quick else 25).print()


if __name__ == "__main__":
    main()
