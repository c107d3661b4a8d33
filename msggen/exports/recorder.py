"""A recorder: takes the samples of a vehicle from the thread of the link, and writes them in a thread of its own.

A recording keeps the definitions of its topics: those with the hashes that the vehicle tells.
"""

from __future__ import annotations

import errno
import os
import re
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from math import inf
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from msggen.link.link import NotConnectedError, Route
from msggen.messages.firmware import releases
from msggen.messages.packages import classes_of, has_definition

if TYPE_CHECKING:
    from msggen.exports.writer import Channel, Writer
    from msggen.vehicle.vehicle import Vehicle

QUEUE = 64 * 1024 * 1024
"""The bytes that wait for the disk at most; what exceeds them is dropped. 30 s of 6,000 samples a second."""

FLUSH = 1.0
"""The time in s after which what was received is in the file."""

_OVERHEAD = 200
"""The bytes of a waiting sample besides its payload."""
_PAUSE = 0.1
"""The time in s between two looks at the queue: a wake-up for each sample would cost more than writing it."""
_TURN = 32
"""The samples after which the thread of the link gets its turn, which would wait for 5 ms otherwise."""
_SYNCED = 3_600_000_000_000
"""The difference in ns between `timestamp` and arrival up to which the clock of the vehicle counts as synchronised."""
_TIMESTAMP = struct.Struct("<B2xQ")
_LITTLE_ENDIAN = 1

PATIENCE = 5.0
"""How long to wait in s for the hashes of a vehicle. It tells all of them within 2 s, or none."""


class Limits(NamedTuple):
    """When a recording ends, and when it continues in another file. None is never."""

    size: float | None = None
    """The bytes of all files after which it ends."""
    split_size: float | None = None
    """The bytes after which a file ends."""
    split_seconds: float | None = None
    """The time after which a file ends, of the arrival of samples."""

    @property
    def is_split(self) -> bool:
        """Whether there may be several files."""
        return self.split_size is not None or self.split_seconds is not None


class Counts(NamedTuple):
    """What was recorded so far."""

    samples: dict[str, int]
    """The samples of each topic that were written."""
    dropped: int
    """The samples that were not written, because too many waited for the disk."""
    size: int
    """The bytes of all files, without what waits for the next chunk."""
    files: tuple[str, ...]
    unknown: frozenset[str]
    """The topics whose definition is not known."""


class _Topic(NamedTuple):
    """A topic in a file."""

    number: int
    route: Route
    channel: Channel


class _File:
    """A file and its topics."""

    def __init__(self, path: str, compression: str, clock: str) -> None:
        from msggen.exports.writer import Writer

        self.writer: Writer = Writer(path, compression, clock)
        self.topics: dict[str, _Topic] = {}
        self.first = 0
        """The arrival of the first sample, 0 before it."""
        self.is_full = False


class Recorder:
    """Records samples until it is closed. `take` is a watcher: `vehicle.watch(recorder.take)`.

    `path` is the first file; with a limit for files, `flight.mcap` stands for flight_0.mcap, flight_1.mcap, ... None
    of them may exist at the start. The number of a file that appears later is left out.

    `describe` returns the channel of a route, and may be slow. It is called by the thread of the recorder once
    `is_ready` returns True; until then, samples wait. `takes` tells whether to record a route. `clock` is a note on the
    times of messages, for the metadata of the files.

    `ended` is set when the recording has ended by itself: by a limit, or by an error of the disk, which `error` has.
    Raises OSError if the first file cannot be created, FileExistsError among them.
    """

    def __init__(  # noqa: PLR0913 - keywords, most of which have a default
        self,
        path: str,
        describe: Callable[[Route], Channel],
        *,
        takes: Callable[[Route], bool] = lambda _: True,
        is_ready: Callable[[], bool] = lambda: True,
        compression: str = "zstd",
        limits: Limits = Limits(),  # noqa: B008 - it is immutable
        clock: str = "",
    ) -> None:
        self._path, self._compression, self._limits, self._clock = path, compression, limits, clock
        self._describe, self._takes, self._is_ready = describe, takes, is_ready
        self._queue: deque[tuple[Route, bytes, int]] = deque()
        self._put = self._taken = self._dropped = 0
        self._chosen: dict[Route, bool] = {}
        self._samples: dict[str, int] = {}
        self._flushed: dict[str, int] = {}
        """The samples that are in the files, of those that were given to the writer."""
        self._unknown: set[str] = set()
        self._files: list[str] = []
        self._earlier = 0
        self._longest = inf if limits.split_seconds is None else limits.split_seconds * 1e9
        self._has_news = False
        self._closing, self.ended = threading.Event(), threading.Event()
        self.error: Exception | None = None
        taken = taken_part(path) if limits.is_split else None
        if taken is not None:
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), taken)
        self._number = 0
        self._file = self._open()
        self._thread = threading.Thread(target=self._run, name="msggen recorder", daemon=True)
        self._thread.start()

    # the thread of the link

    def take(self, route: Route, payload: bytes, time: int) -> None:
        """Queue a sample. Only one thread calls this."""
        is_chosen = self._chosen.get(route)
        if is_chosen is None:
            is_chosen = self._chosen[route] = self._takes(route)
        if not is_chosen or self.ended.is_set():
            return
        size = len(payload) + _OVERHEAD
        if self._put - self._taken + size > QUEUE:
            self._dropped += 1
            return
        self._put += size
        self._queue.append((route, payload, time))

    # any thread

    def counts(self) -> Counts:
        """Return what was recorded so far."""
        size = self._earlier + self._file.writer.size
        return Counts(self._samples.copy(), self._dropped, size, tuple(self._files), frozenset(self._unknown.copy()))

    def describe_again(self) -> None:
        """Ask for the channels of all routes again, because more is known of their definitions."""
        self._has_news = True

    def close(self) -> None:
        """Write what waits, and end the file. Can be repeated."""
        self._closing.set()
        self._thread.join()

    # the thread of the recorder

    def _run(self) -> None:
        try:
            self._record()
            self._file.writer.close()
        except Exception as error:  # noqa: BLE001 - it is told by the thread that waits for the recorder
            self.error = error
            self._samples = self._flushed
            self._file.writer.abandon()
        finally:
            self.ended.set()

    def _record(self) -> None:
        flushed = time.monotonic()
        while not self._closing.wait(_PAUSE):
            if self._is_ready():
                self._write()
            now = time.monotonic()
            if now - flushed >= FLUSH:
                flushed = now
                if self._flush():
                    return
        self._write()

    def _write(self) -> None:
        """Write what waits now."""
        if self._has_news:
            self._has_news = False
            self._forget_changed()
        queue, samples = self._queue, self._samples
        for number in range(len(queue)):
            route, payload, arrival = queue.popleft()
            self._taken += len(payload) + _OVERHEAD
            if not self._file.first:
                self._file.first = arrival
            elif self._file.is_full or arrival >= self._file.first + self._longest:
                self._split(arrival)
            topic = self._file.topics.get(route.name) or self._add(route)
            self._file.writer.write(topic.number, arrival, publish_time(payload, arrival), payload)
            samples[route.name] = samples.get(route.name, 0) + 1
            if not number % _TURN:
                time.sleep(0)

    def _add(self, route: Route) -> _Topic:
        channel = self._describe(route)
        if channel.definition:
            self._unknown.discard(route.name)
        else:
            self._unknown.add(route.name)
        topic = _Topic(self._file.writer.add_channel(channel), route, channel)
        self._file.topics[route.name] = topic
        return topic

    def _forget_changed(self) -> None:
        """Let topics whose definition is another one now have another channel from now on."""
        for name, topic in tuple(self._file.topics.items()):
            if self._describe(topic.route) != topic.channel:
                del self._file.topics[name]

    def _flush(self) -> bool:
        """Write a chunk. Return whether the recording is as large as it may be."""
        writer, limits = self._file.writer, self._limits
        writer.flush()
        self._flushed = self._samples.copy()
        writer.sync()
        self._file.is_full = limits.split_size is not None and writer.size >= limits.split_size
        return limits.size is not None and self._earlier + writer.size >= limits.size

    def _split(self, arrival: int) -> None:
        """Continue in another file, whose first sample is the next one."""
        self._file.writer.close()
        self._flushed = self._samples.copy()
        self._earlier += self._file.writer.size
        self._file = self._open()
        self._file.first = arrival

    def _open(self) -> _File:
        path = self._path
        if self._limits.is_split:
            while os.path.lexists(path := part_of(self._path, self._number)):
                self._number += 1
        file = _File(path, self._compression, self._clock)
        self._files.append(path)
        return file


def part_of(path: str, number: int) -> str:
    """Return the path of a file of a recording that has several: `flight_0.mcap` for `flight.mcap`."""
    front, end = os.path.splitext(path)
    return f"{front}_{number}{end}"


def taken_part(path: str) -> str | None:
    """Return a file that exists and has the name of a part of the recording `path`, None if there is none."""
    front, end = os.path.splitext(path)
    folder, name = os.path.split(front)
    part = re.compile(rf"{re.escape(name)}_\d+{re.escape(end)}")
    try:
        found = sorted(each for each in os.listdir(folder or os.curdir) if part.fullmatch(each))
    except OSError:
        return None  # creating the first file tells why
    return os.path.join(folder, found[0]) if found else None


def publish_time(payload: bytes, arrival: int) -> int:
    """Return the time in ns at which a sample was published: its `timestamp`, or else that of its arrival.

    `timestamp` is the first field of the messages of PX4, a uint64 in us. It is UTC if the vehicle has synchronised
    its clock (docs/frames.md); a value that is more than an hour off is not.
    """
    try:
        encapsulation, timestamp = _TIMESTAMP.unpack_from(payload, 1)
    except struct.error:
        return arrival
    found: int = timestamp * 1000
    return found if encapsulation == _LITTLE_ENDIAN and abs(found - arrival) <= _SYNCED else arrival


class Definitions:
    """The definitions of a vehicle: those of `package`, or of an embedded release if the vehicle's hash is there.

    `package_of` returns the generated package of a release. A vehicle that tells no hash of a message has that of
    `package`, as for `subscribe`.
    """

    def __init__(self, vehicle: Vehicle, package: ModuleType, package_of: Callable[[str], ModuleType]) -> None:
        self._vehicle, self._package, self._package_of = vehicle, package, package_of
        self._hashes: Mapping[str, int] = {}
        self._is_complete = False
        self._deadline = time.monotonic() + PATIENCE

    def is_complete(self) -> bool:
        """Whether the hashes of the vehicle are known, or will not be."""
        if not self._is_complete:
            self._is_complete = self.update() or time.monotonic() > self._deadline
        return self._is_complete

    def update(self) -> bool:
        """Take over the hashes that the vehicle has told. Return whether it was asked for all of them."""
        try:
            firmware = self._vehicle.firmware
        except NotConnectedError:
            return False
        if firmware.hashes:
            self._hashes = {**self._hashes, **firmware.hashes}
        return firmware.is_complete

    @property
    def hashes(self) -> Mapping[str, int]:
        """The hashes that the vehicle has told, by ROS type."""
        return self._hashes

    def channel(self, route: Route) -> Channel:
        """Return the channel of a route. Its definition is "" if no package has the vehicle's."""
        from msggen.exports.writer import Channel

        told = self._hashes.get(route.ros_type)
        for package in self._packages(route, told):
            for cls in classes_of(package, route.name, route.ros_type):
                info = cls.__msg__
                if has_definition(cls, route, told):
                    return Channel(route.name, route.ros_type, info.definition, info.type_hash)
        return Channel(route.name, route.ros_type, "", "")

    def _packages(self, route: Route, told: int | None) -> Iterator[ModuleType]:
        yield self._package
        name = route.ros_type.rpartition("/")[2]
        for release, rows in releases().items():
            if told is not None and any(row.message == name and row.message_hash == told for row in rows.values()):
                yield self._package_of(release)
