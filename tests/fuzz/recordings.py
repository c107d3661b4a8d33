"""Recorders that are killed at a random moment: the file has all samples up to its last chunk, for every reader."""

from __future__ import annotations

import multiprocessing
import os
import struct
import time
from pathlib import Path
from random import Random
from typing import NamedTuple

from mcap.writer import MCAP0_MAGIC

from msggen.exports import recorder, writer
from msggen.link.link import Route
from support.recordings import START, check_read, read_mcap, read_ours
from support.scratch import scratch_folder

COUNT = 12

_NUMBER = struct.Struct("<Q")
_LONGEST = 0.3
"""Seconds until the recorder is killed at the latest."""


class Case(NamedTuple):
    """A recorder that writes chunks after some time, and gets some samples at a time."""

    moment: float
    """When it is killed, as a part of the longest time."""
    compression: str
    chunk_seconds: float
    samples: int
    size: int
    split_size: float | None


def case(chance: Random) -> Case:
    """Return a random recorder."""
    return Case(
        chance.random(),
        chance.choice(writer.COMPRESSIONS),
        chance.choice((0.0, 0.01, 0.1)),
        chance.choice((1, 20, 500)),
        chance.choice((0, 60, 5000)),
        chance.choice((None, None, 20_000, 200_000)),
    )


def check(case: Case) -> None:
    """Kill the recorder, and read its files."""
    with scratch_folder() as folder:
        reader, told = os.pipe()
        process = multiprocessing.get_context("fork").Process(target=_record, args=(folder, case, told))
        process.start()
        os.close(told)
        try:
            first = os.read(reader, _NUMBER.size)  # the file exists
            time.sleep(case.moment * _LONGEST)
            process.kill()
            process.join()
            written = first + _read_all(reader)
        finally:
            os.close(reader)
        safe = max(number for (number,) in _NUMBER.iter_unpack(written))
        # a recorder that is killed before it writes into a new file leaves it empty
        made = (path for path in folder.iterdir() if path.stat().st_size)
        files = sorted(made, key=lambda path: int(path.stem.partition("_")[2] or 0))
        found = [sample for path in files for sample in read_ours(path)]
        assert [sample.time - START for sample in found] == list(range(len(found)))
        assert len(found) >= safe, f"{len(found)} of {safe} samples that were written"
        for sample in found:
            assert sample.payload == _payload(sample.time - START, case.size)
        for path in files:
            # a recorder that is killed within the call that writes a chunk leaves a part of it
            if path.read_bytes().endswith(MCAP0_MAGIC) and read_ours(path):
                check_read(path, read_mcap(path))


def _read_all(descriptor: int) -> bytes:
    found = b""
    while data := os.read(descriptor, 65536):
        found += data
    return found


def _payload(number: int, size: int) -> bytes:
    return b"\0\1\0\0" + _NUMBER.pack(number) + bytes(size)


def _record(folder: Path, case: Case, told: int) -> None:
    """Record without end, and tell the number of samples that are in the files after each chunk."""
    recorder.FLUSH, recorder._PAUSE = case.chunk_seconds, 0.001
    real = writer.Writer.sync

    def sync(self: writer.Writer) -> None:
        real(self)
        os.write(told, _NUMBER.pack(sum(made.counts().samples.values())))

    writer.Writer.sync = sync  # type: ignore[method-assign]
    limits = recorder.Limits(split_size=case.split_size)
    route = Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 1)
    channel = writer.Channel(route.name, route.ros_type, "uint64 timestamp\n", "")
    made = recorder.Recorder(
        str(folder / "flight.mcap"), lambda _: channel, compression=case.compression, limits=limits
    )
    os.write(told, _NUMBER.pack(0))
    number = 0
    while not made.ended.is_set():
        for _ in range(case.samples):
            if made._put - made._taken < recorder.QUEUE // 2:
                made.take(route, _payload(number, case.size), START + number)
                number += 1
        time.sleep(0.001)
