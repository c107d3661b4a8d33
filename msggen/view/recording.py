"""Shows a recording in MCAP in Foxglove."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from foxglove.websocket import PlaybackCommand, PlaybackState, PlaybackStatus, ServerListener
from mcap.exceptions import McapError
from mcap.reader import McapReader, NonSeekingReader, SeekingReader

from msggen.view.playback import Playback, Sample, State
from msggen.view.scene import KINDS, Scene
from msggen.view.server import Channel

if TYPE_CHECKING:
    from foxglove.websocket import PlaybackControlRequest
    from mcap.records import Channel as McapChannel
    from mcap.records import Message, Schema
    from mcap.summary import Summary

    from msggen.view.server import Server

TELL_NS = 200_000_000
"""How often Foxglove is told where the playback is."""


DAMAGES = (McapError, struct.error, ValueError, EOFError)
"""What the package mcap raises for files that are damaged, or no MCAP files."""


class UnreadableRecordingError(ValueError):
    """A file that is no recording that can be shown."""


class Recording(NamedTuple):
    """A recording: its topics, and the times of its first and last samples in ns since 1970."""

    file: BinaryIO
    topics: Mapping[str, Channel]
    first: int
    last: int
    is_indexed: bool
    """Whether the file has its summary, so that a time can be found. Otherwise it is read from the start."""

    def read(self, start: int) -> Iterator[Sample]:
        """Yield the samples from a time on, in order of their log times. Ends at the first damage."""
        with suppress(*DAMAGES):
            for _, channel, message in _messages(self.file, start, is_indexed=self.is_indexed):
                if channel.topic in self.topics:
                    yield Sample(message.log_time, channel.topic, message.data)


def read_recording(file: BinaryIO) -> Recording:
    """Return the recording in a file. Raises UnreadableRecordingError."""
    topics: dict[str, Channel] = {}
    pairs: list[tuple[Schema | None, McapChannel]] = []
    first, last = 1 << 63, 0
    summary = _summary(file)
    if summary is not None and summary.statistics is not None:
        pairs = [(summary.schemas.get(each.schema_id), each) for each in summary.channels.values()]
        first, last = summary.statistics.message_start_time, summary.statistics.message_end_time
    else:  # the file was cut off: read all of it once
        with suppress(*DAMAGES):
            for schema, channel, message in _messages(file, 0, is_indexed=False):
                pairs.append((schema, channel))
                first, last = min(first, message.log_time), max(last, message.log_time)
    for schema, channel in pairs:
        if schema is not None and schema.encoding == "ros2msg" and channel.message_encoding == "cdr":
            topics[channel.topic] = Channel(channel.topic, schema.name, schema.data.decode("utf-8", "replace"))
    if not (topics and last):
        raise UnreadableRecordingError("no MCAP file with samples in CDR and definitions of ROS 2 (ros2msg)")
    return Recording(file, topics, first, last, summary is not None)


def package_for(recording: Recording, packages: Iterable[ModuleType]) -> ModuleType | None:
    """Return the first package whose messages with the vehicle's place have the definitions of the recording."""
    needed = {each.ros_type: _fields(each.definition) for each in recording.topics.values() if each.ros_type in KINDS}
    for package in packages if needed else ():
        with suppress(KeyError):
            own = {name: _fields(package.by_type(name).__msg__.definition) for name in needed}
            if own == needed:
                return package
    return None


def _fields(definition: str) -> list[str]:
    """Return the lines of a definition without comments and spaces."""
    lines = ("".join(line.partition("#")[0].split()) for line in definition.splitlines())
    return [line for line in lines if line]


def _summary(file: BinaryIO) -> Summary | None:
    file.seek(0)
    try:
        return SeekingReader(file).get_summary()
    except DAMAGES:
        return None


def _messages(file: BinaryIO, start: int, *, is_indexed: bool) -> Iterator[tuple[Schema | None, McapChannel, Message]]:
    file.seek(0)
    reader: McapReader = SeekingReader(file) if is_indexed else NonSeekingReader(file)
    return reader.iter_messages(starting_at=start, log_time_order=is_indexed)


class Controls(ServerListener):
    """Foxglove's playback controls: a listener for the server, whose thread calls it."""

    def __init__(self) -> None:
        self.answer: Callable[[PlaybackControlRequest], PlaybackState] | None = None

    def on_playback_control_request(self, request: PlaybackControlRequest) -> PlaybackState | None:
        """Do what the controls ask for, and return where the playback is then."""
        return self.answer(request) if self.answer else None


class RecordingView:
    """Gives the samples of a recording to a server. Call `advance` often, from one thread.

    `package` is that of `package_for`, which decodes the messages with the vehicle's place.
    """

    def __init__(self, server: Server, recording: Recording, controls: Controls, package: ModuleType | None) -> None:
        self._server, self._package = server, package
        self._scene = Scene(package) if package else None
        self._types = {each.topic: each.ros_type for each in recording.topics.values()}
        self._playback = Playback(recording.read, recording.first, recording.last, time.monotonic_ns())
        self._lock = threading.Lock()
        """Guards the playback: the controls are called by the thread of the server."""
        self._told = 0
        self.samples = 0
        for channel in recording.topics.values():
            server.add(channel)
        controls.answer = self._answer

    def advance(self) -> State:
        """Send the samples that are due, and return where the playback is."""
        now = time.monotonic_ns()
        with self._lock:
            samples, state = list(self._playback.due(now)), self._playback.state(now)
        for sample in samples:
            self._server.sample(sample.topic, sample.payload, sample.time)
            self._draw(sample)
        self.samples += len(samples)
        if now - self._told >= TELL_NS:
            self._told = now
            self._server.draw_model(state.time)
            self._server.set_playback(_told(state))
        return state

    def _draw(self, sample: Sample) -> None:
        ros_type = self._types[sample.topic]
        if self._scene is None or self._package is None or ros_type not in KINDS:
            return
        with suppress(ValueError):  # a damaged sample
            message = self._package.by_type(ros_type).decode(sample.payload)
            found = self._scene.feed(ros_type, message, sample.time)
            if found is not None:
                self._server.draw(found, sample.time)

    def _answer(self, request: PlaybackControlRequest) -> PlaybackState:
        now = time.monotonic_ns()
        with self._lock:
            self._playback.control(
                now,
                is_playing=request.playback_command == PlaybackCommand.Play,
                speed=request.playback_speed,
                seek=request.seek_time,
            )
            state = self._playback.state(now)
        return _told(state, request)


def _told(state: State, request: PlaybackControlRequest | None = None) -> PlaybackState:
    running = PlaybackStatus.Playing if state.is_playing else PlaybackStatus.Paused
    return PlaybackState(
        PlaybackStatus.Ended if state.is_ended else running,
        state.time,
        state.speed,
        request is not None and request.seek_time is not None,
        request.request_id if request else None,
    )
