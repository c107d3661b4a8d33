"""`msggen record`: record the topics of a running vehicle in MCAP files."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from math import inf
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted, few, input_error
from msggen.base.recording_formats import MCAP
from msggen.cli.commands.topic.naming import not_shared
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.options import (
    ENDED_CODES,
    Run,
    add_flag,
    add_repeatable,
    add_shared,
    add_value,
    check_free,
    new_command,
    refuse,
)
from msggen.cli.packages import needing
from msggen.cli.printing import discard_output, number_of_bytes
from msggen.cli.screen import Status
from msggen.cli.values import Deferred, local_path, non_empty, positive
from msggen.cli.watching import check_link, watching
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.exports.recorder import Counts, Definitions, Recorder
    from msggen.recordings.topics.choice import Choice
    from msggen.vehicle.vehicle import Vehicle

_REFRESH = 1.0
"""The time in s between two looks at the vehicle, and after which the state is shown."""
_COMPRESSIONS = ("zstd", "lz4", "none")
_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


_SINCE_BOOT = (
    "the vehicle's messages have times since its boot, as PX4's module zenoh sends them; log times are those of arrival"
)
"""What is said of a recording of a vehicle on Zenoh."""


@new_command(
    "record",
    "record the topics of a running vehicle in an MCAP file",
    "Record what a running vehicle publishes, and on request what programs send to it, in an MCAP "
    "file, which ros2 bag, Foxglove and `msggen play` read. Ctrl-C ends the recording. The file is whole at any "
    "time, even if the program is killed.",
    epilog=ENDED_CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_topics(parser, "record")
    text = "record what PX4 publishes (out), what programs on the link publish to PX4 (in), or both (default: out)"
    parser.add_argument("--direction", choices=("out", "in", "both"), default="out", metavar="WAY", help=text)
    text = "file to write, or folder for a file that is named after the time (default: the current folder)"
    add_value(parser, "-o, --output", "FILE|DIR", local_path, text)
    add_shared(parser, "--for")
    add_value(parser, "--max-size", "SIZE", _size, "end at this size of all files, such as 2G")
    add_value(parser, "--split-size", "SIZE", _size, "continue in another file at this size, such as 500M")
    add_value(parser, "--split-every", "SECONDS", positive, "continue in another file after this time")
    text = f"{', '.join(_COMPRESSIONS)} (default: {_COMPRESSIONS[0]})"
    parser.add_argument("--compression", choices=_COMPRESSIONS, default=_COMPRESSIONS[0], metavar="NAME", help=text)
    add_flag(parser, "--json", "print the summary as JSON, and nothing else")
    add_link(parser)
    add_shared(parser, "-q, --quiet")
    return _record


def add_topics(parser: argparse.ArgumentParser, verb: str) -> None:
    """Add the arguments that choose topics to record or to play."""
    text = (
        f"topics to {verb}, such as vehicle_status, VehicleStatus, /fmu/out/vehicle_status_v4 or 'sensor_*' "
        "(default: all)"
    )
    add_value(parser, "topics", "TOPIC", non_empty, text, nargs="*", default=[])
    add_repeatable(parser, "--exclude", "TOPIC", non_empty, "topic to leave out, spelt as the others")


@Deferred
def _size(text: str) -> float:
    """Return the bytes in a text such as 500M."""
    number, unit = (text[:-1], text[-1].lower()) if text[-1].isalpha() else (text, "")
    try:
        found = float(number) * _UNITS[unit]
    except (KeyError, ValueError):
        found = 0.0
    if not 1 <= found < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a number of bytes such as 500M or 2G, found {text!r}")
    return found


def _record(options: argparse.Namespace) -> None:
    from msggen.exports.recorder import Definitions
    from msggen.recordings.topics.choice import Choice

    check_packages("R101")
    check_free(_first_file(options.output, options))  # before the vehicle is waited for
    choice = Choice(options.topics, options.exclude)

    def check(package: ModuleType) -> None:
        rows = ((each.direction, each.ros_name, each.message.__msg__.ros_type) for each in package.topics.ENDPOINTS)
        _check_topics(options, choice, rows)

    with connection(options, check, needs_types=False) as found:
        if options.direction != "out" and not found.vehicle.is_shared:
            options.parser.error(f"argument --direction: {not_shared(found.link)}")
        _check_topics(options, choice, ((each.direction, each.name, each.ros_type) for each in found.vehicle.routes))
        from msggen.generate.cache import package_of

        definitions = Definitions(found.vehicle, found.package, package_of)
        clock = _clock_of(found.vehicle)
        recorder = _open(options, choice, definitions, clock)
        _Session(options, found, recorder, definitions, clock).run()


def _clock_of(vehicle: Vehicle) -> str:
    """Return a note on the times of a vehicle's messages, "" for none."""
    from msggen.link.link import NotConnectedError

    with suppress(NotConnectedError):
        return _SINCE_BOOT if vehicle.remote.guid else ""
    return ""


def check_packages(code: str) -> None:
    """Raise an InputError if a package of the extra is missing."""
    with needing("recordings", code):
        import mcap.records  # noqa: F401


# The file


def _path(output: str | None) -> str:
    """Return the file to write."""
    name = time.strftime("px4_%Y-%m-%d_%H-%M-%S") + MCAP
    if output is None:
        return name
    if os.path.isdir(output) or output.endswith((os.sep, "/")):
        return os.path.join(output, name)
    return output if os.path.splitext(output)[1] else output + MCAP


def _first_file(output: str | None, options: argparse.Namespace) -> str:
    """Return the file to write; of several, one that exists, or else the first one."""
    from msggen.exports.recorder import part_of, taken_part

    path = _path(output)
    if options.split_size is None and options.split_every is None:
        return path
    return taken_part(path) or part_of(path, 0)


def _open(options: argparse.Namespace, choice: Choice, definitions: Definitions, clock: str) -> Recorder:
    from msggen.exports.recorder import Limits, Recorder

    path = _path(options.output)
    try:
        return Recorder(
            path,
            definitions.channel,
            takes=lambda route: choice.takes(route.name, route.ros_type),
            is_ready=definitions.is_complete,
            compression=options.compression,
            limits=Limits(options.max_size, options.split_size, options.split_every),
            clock=clock,
        )
    except FileExistsError as error:
        check_free(str(error.filename))
        raise
    except OSError as error:
        raise input_error(path, "R101", f"cannot be written: {error.strerror}", 0) from None


def _check_topics(options: argparse.Namespace, choice: Choice, rows: Iterable[tuple[str, str, str]]) -> None:
    """Refuse names that no topic has. The rows are directions, names and types of those of a vehicle."""
    named: dict[str, list[tuple[str, str]]] = {"out": [], "in": []}
    for direction, *topic in rows:
        named[direction].append((topic[0], topic[1]))
    way = options.direction
    problem = choice.problem([*named["out"], *named["in"]] if way == "both" else named[way])
    if problem and not choice.problem([*named["out"], *named["in"]]):
        verb = "publishes" if way == "in" else "reads"
        refuse(options, f"argument TOPIC: PX4 {verb} some of these topics: --direction both records all of them")
    if problem:
        refuse(options, f"argument TOPIC: {problem}: `msggen topic list` prints those of the vehicle")


# The run


class _Session:
    """A recording that runs, and what is told of it."""

    def __init__(
        self,
        options: argparse.Namespace,
        found: Connection,
        recorder: Recorder,
        definitions: Definitions,
        clock: str,
    ) -> None:
        self._options, self._found, self._clock = options, found, clock
        self._recorder, self._definitions = recorder, definitions
        self._losses = _Losses(found.vehicle)
        self._status = Status(is_quiet=options.quiet or options.json)
        self._start = time.monotonic()

    def run(self) -> None:
        """Record until the end. Raises InputError if the disk fails."""
        recorder = self._recorder
        self._show(f"recording {self._found.label} on {self._found.link} to {recorder.counts().files[0]}")
        watch = self._found.vehicle.watch(recorder.take, self._options.direction)
        try:
            with _interrupted_by_sigterm(), watching():
                self._wait()
            self._losses.update()
        finally:
            seconds = time.monotonic() - self._start
            watch.close()
            recorder.close()
        self._summarise(recorder.counts(), seconds)
        if isinstance(recorder.error, OSError):
            text = f"cannot be written: {recorder.error.strerror}; what was recorded before is in the file"
            raise input_error(recorder.counts().files[-1], "R101", text, 0)
        if recorder.error is not None:
            raise recorder.error

    def _wait(self) -> None:
        """Wait for the end of the recording, and tell what happens."""
        end = self._start + (self._options.seconds or inf)
        hashes, is_connected = self._definitions.hashes, True
        while time.monotonic() < end:
            if self._recorder.ended.wait(min(_REFRESH, end - time.monotonic())):
                return
            self._losses.update()
            if self._definitions.is_complete():
                self._definitions.update()
                if hashes != self._definitions.hashes:
                    hashes = self._definitions.hashes
                    self._recorder.describe_again()
            is_connected = self._tell_connection(was_connected=is_connected)
            self._show(state=self._state)

    def _tell_connection(self, *, was_connected: bool) -> bool:
        """Tell when the vehicle disconnects and connects again. Return whether it is connected."""
        vehicle = self._found.vehicle
        is_connected = vehicle.is_connected
        if not is_connected:
            check_link(vehicle)
        if is_connected and not was_connected:
            self._show(f"{self._elapsed():8.1f} s  connected again")
        elif was_connected and not is_connected:
            self._show(f"{self._elapsed():8.1f} s  disconnected: {vehicle.wait_disconnected(0)}")
        return is_connected

    def _elapsed(self) -> float:
        return time.monotonic() - self._start

    def _state(self) -> str:
        return f"{self._elapsed():8.1f} s  {_shown(self._recorder.counts(), self._losses.count)}"

    def _show(self, *lines: str, state: Callable[[], str] = str) -> None:
        """Show lines and the state. The recording goes on if they cannot be printed."""
        try:
            self._status.show(*lines, state=state)
        except OSError:
            discard_output()

    def _summarise(self, counts: Counts, seconds: float) -> None:
        if self._options.json:
            notes = [self._clock] if self._clock else []
            print(dump({**_summary(counts, self._losses.count, seconds), "notes": notes}))
            return
        text = _shown(counts, self._losses.count)
        files = f", {len(counts.files)} files" if len(counts.files) > 1 else ""
        self._show(f"{text}, in {seconds:.1f} s{files}")
        if self._clock:
            self._show(f"note: {self._clock}")
        if counts.dropped:
            text = "were dropped, because the disk was too slow: record fewer topics, or on a faster disk"
            print(f"warning: {counted(counts.dropped, 'sample')} {text}", file=sys.stderr)
        if counts.unknown:
            names = few(sorted(counts.unknown))
            text = (
                "recorded without a definition, because the vehicle's is that of no known release; give it with --px4"
            )
            print(f"warning: {names}: {text} or --types", file=sys.stderr)


class _Losses:
    """The samples of a vehicle that did not arrive, in all its sessions since the recording began."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._sessions: dict[int, int] = {}
        self._before = 0
        self.update()
        self._before = sum(self._sessions.values())

    @property
    def count(self) -> int:
        """The number of samples."""
        return sum(self._sessions.values()) - self._before

    def update(self) -> None:
        """Look at the vehicle."""
        from msggen.link.link import NotConnectedError

        with suppress(NotConnectedError):
            self._sessions[self._vehicle.remote.number] = self._vehicle.lost


def _shown(counts: Counts, lost: int) -> str:
    """Return what was recorded, in a line."""
    samples = sum(counts.samples.values())
    topics, missing = counted(len(counts.samples), "topic"), lost + counts.dropped
    return f"{topics}, {counted(samples, 'sample')}, {number_of_bytes(counts.size)}, {missing} lost"


def _summary(counts: Counts, lost: int, seconds: float) -> Mapping[str, object]:
    return {
        "files": counts.files,
        "seconds": round(seconds, 3),
        "samples": sum(counts.samples.values()),
        "bytes": counts.size,
        "lost": lost,
        "dropped": counts.dropped,
        "topics": {name: counts.samples[name] for name in sorted(counts.samples)},
        "without_definition": sorted(counts.unknown),
    }


@contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM, as of systemd and docker, end the recording as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
