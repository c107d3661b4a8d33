"""Shows a recording in Foxglove, at the pace that its playback controls ask for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

from foxglove.websocket import PlaybackCommand, PlaybackState, PlaybackStatus, ServerListener

from msggen.base.recording_formats import FORMATS
from msggen.recordings.log.log import Log
from msggen.recordings.log.payloads import Sample
from msggen.recordings.source.source import RecordingError
from msggen.show.view.scene import KINDS, Scene
from msggen.show.view.server import Channel

if TYPE_CHECKING:
    from foxglove.websocket import PlaybackControlRequest

    from msggen.recordings.topics.topic import Topic
    from msggen.show.view.server import Server


class State(NamedTuple):
    """Where a playback is. `time` is in ns since 1970, of the recording."""

    is_playing: bool
    time: int
    speed: float
    is_ended: bool


SLOWEST, FASTEST = 0.01, 100.0
"""The bounds of the speed."""

_MOST = 10_000
"""The most samples that are due at once: after a long pause of the computer, the playback goes on from there."""


class Playback:
    """A playback of the samples from `first` to `last`, which `read` yields from a time on, in order of their times.

    Samples that are older than `first` come at once. `now` is in ns of the monotonic clock, which the caller reads.
    Nothing is locked: one thread uses it.
    """

    def __init__(self, read: Callable[[int], Iterator[Sample]], first: int, last: int, now: int) -> None:
        self._read, self._first, self._last = read, first, last
        self._samples = read(first)
        self._next = next(self._samples, None)
        self._is_playing, self._speed = True, 1.0
        self._time, self._since = first, now

    def state(self, now: int) -> State:
        """Return where the playback is."""
        time = self._position(now)
        is_ended = self._next is None and time >= self._last
        return State(self._is_playing and not is_ended, time, self._speed, is_ended)

    def control(self, now: int, *, is_playing: bool, speed: float, seek: int | None) -> None:
        """Do what the controls ask for. `seek` is a time of the recording in ns, or None to stay."""
        self._time, self._since = self._position(now), now
        if is_playing and seek is None and self._next is None and self._time >= self._last:
            seek = self._first  # playing after the end begins anew
        self._is_playing = is_playing
        self._speed = min(max(speed, SLOWEST), FASTEST) if speed > 0 else self._speed
        if seek is not None:
            self._time = min(max(seek, self._first), self._last)
            self._samples = self._read(self._time)
            self._next = next(self._samples, None)

    def due(self, now: int) -> Iterator[Sample]:
        """Yield the samples whose time has come, at most 10,000."""
        time = self._position(now)
        for _ in range(_MOST):
            sample = self._next
            if sample is None or sample.time > time:
                return
            self._next = next(self._samples, None)
            yield sample
        if self._next is not None:
            self._time, self._since = max(self._next.time, self._first), now

    def _position(self, now: int) -> int:
        if not self._is_playing:
            return self._time
        return min(self._last, self._time + round((now - self._since) * self._speed))


TELL_NS = 200_000_000
"""How often Foxglove is told where the playback is."""


class UnviewableRecordingError(RecordingError):
    """A recording without anything that can be shown."""


def channels_of(recording: Log) -> list[Channel]:
    """Return the topics with definitions. Raises UnviewableRecordingError if there is none."""
    found = [Channel(topic.name, topic.ros_type, topic.definition) for topic in _shown(recording)]
    if not found or not recording.end:
        if FORMATS[recording.kind].is_of_vehicle:
            raise UnviewableRecordingError("is a ULog, which cannot be viewed: convert it to MCAP first")
        raise UnviewableRecordingError("has no samples with definitions of ROS 2 (ros2msg)")
    return found


def _shown(recording: Log) -> list[Topic]:
    return [topic for topic in recording.topics if topic.is_cdr and topic.definition]


def package_for(recording: Log, packages: Iterable[ModuleType]) -> ModuleType | None:
    """Return the first package whose messages with the vehicle's place have the definitions of the recording."""
    needed = {each.ros_type: _fields(each.definition) for each in _shown(recording) if each.ros_type in KINDS}
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

    def __init__(self, server: Server, recording: Log, controls: Controls, package: ModuleType | None) -> None:
        channels = channels_of(recording)
        self._server, self._log, self._package = server, recording, package
        self._types = {channel.topic: channel.ros_type for channel in channels}
        self._scene = Scene(package) if package else None
        self._playback = Playback(self._read, recording.start, recording.end, time.monotonic_ns())
        self._lock = threading.Lock()
        """Guards the playback: the controls are called by the thread of the server."""
        self._told = 0
        self.samples = 0
        for channel in channels:
            server.add(channel)
        controls.answer = self._answer

    def _read(self, start: int) -> Iterator[Sample]:
        """Yield the samples from a time on."""
        seconds = max(start - self._log.start, 0) / 1e9
        return self._log.payloads(self._types, start=seconds or None)  # some samples are older than the start

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
