"""`msggen view`: show a running vehicle or a recording in Foxglove."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from logging import CRITICAL
from math import inf
from typing import TYPE_CHECKING

from msggen.base.diagnostics import counted, input_error
from msggen.base.foreign import escaped
from msggen.cli.chosen_types import is_given, known_types
from msggen.cli.link import add_link, connection
from msggen.cli.options import ENDED_CODES, Run, add_shared, add_value, new_command
from msggen.cli.packages import check_reading, needing, read_errors
from msggen.cli.values import local_path, non_empty, whole
from msggen.cli.watching import rounds, telling, watching
from msggen.generate.cache import package_of
from msggen.sources.embedded import EMBEDDED

if TYPE_CHECKING:
    from types import ModuleType

    from msggen.recordings.log.log import Log
    from msggen.show.view.recording import Controls, RecordingView
    from msggen.show.view.server import Server

_HOST, _PORT = "127.0.0.1", 8765
_LOCAL = ("127.0.0.1", "::1", "localhost")
_SLICE = 0.01
"""The time in s between two steps of a playback."""
_CHECK = 0.5
"""The time in s between two looks at a vehicle."""


@new_command(
    "view",
    "show a running vehicle or a recording in Foxglove",
    "Show all topics of a running vehicle, or of a recording, in Foxglove, over its websocket. The "
    "vehicle is also sent as frame, pose and location, so that it moves in the panels 3D and Map. "
    "Needs the packages of the extra `view`.",
    epilog=ENDED_CODES,
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(parser, "file", "FILE", local_path, "recording in MCAP (default: the vehicle on the link)", nargs="?")
    group = parser.add_argument_group("server")
    add_value(group, "--host", "ADDRESS", non_empty, f"address to serve on (default: {_HOST})")
    add_value(group, "--port", "N", whole(0, 65535), f"port to serve on (default: {_PORT})")
    add_shared(group, "--for")
    add_shared(parser, "-q, --quiet")
    add_link(parser)
    return _view


def _view(options: argparse.Namespace) -> None:
    check_reading("L111", "view")
    with needing("view", "L111"):
        from msggen.show.view import recording
    del recording
    with telling(CRITICAL, "foxglove", "foxglove_py"):  # which tell what single clients do
        if options.file:
            _show_recording(options)
        else:
            _show_vehicle(options)


def _show_vehicle(options: argparse.Namespace) -> None:
    from msggen.link.link import NotConnectedError
    from msggen.show.view.live import LiveView

    with connection(options) as found, _server(options, f"msggen: {found.link}") as server:
        view = LiveView(server, found.vehicle, found.package, _warn)
        with found.vehicle.watch(view), watching():
            _announce(options, server, f"{found.label} on {found.link}")
            for _ in rounds(options.seconds, found.vehicle, _CHECK):
                with suppress(NotConnectedError):
                    view.check()
                server.draw_model(time.time_ns())
        _summarise(options, view.samples)


def _show_recording(options: argparse.Namespace) -> None:
    from msggen.show.view.recording import Controls, RecordingView, package_for

    controls = Controls()
    recording = _recording(options.file)
    with _server(options, options.file, recording, controls) as server:
        view = RecordingView(server, recording, controls, package_for(recording, _packages(options)))
        seconds = (recording.end - recording.start) / 1e9
        with watching():
            _announce(options, server, f"{options.file}: {counted(len(recording.topics), 'topic')}, {seconds:.1f} s")
            _play(options, view)
        _summarise(options, view.samples)


def _packages(options: argparse.Namespace) -> Iterator[ModuleType]:
    """Yield the packages whose definitions a recording may have: the given one, or the folder's and all releases."""
    known = known_types(options)
    if known is not None:
        yield known.package
    if not is_given(options):
        yield from map(package_of, EMBEDDED)


def _recording(path: str) -> Log:
    from msggen.recordings.log import opening
    from msggen.show.view.recording import channels_of

    with read_errors(path):
        recording = opening.open(path)
        channels_of(recording)
    return recording


def _server(
    options: argparse.Namespace, name: str, recording: Log | None = None, controls: Controls | None = None
) -> Server:
    from msggen.show.view.server import Server

    host, port = options.host or _HOST, _PORT if options.port is None else options.port
    span = (recording.start, recording.end) if recording else None
    try:
        server = Server(escaped(name), host, port, span, controls)
    except OSError as error:
        text = f"cannot serve there: {error}; another --port, or 0 for a free one"
        raise input_error(f"{host}:{port}", "L102", text, 0) from None
    if host not in _LOCAL:
        _warn(f"the server on {host} has no authentication: whoever reaches it sees all samples")
    return server


def _play(options: argparse.Namespace, view: RecordingView) -> None:
    """Play a recording until the time is over."""
    end = time.monotonic() + (options.seconds or inf)
    while time.monotonic() < end:
        view.advance()
        time.sleep(_SLICE)


def _announce(options: argparse.Namespace, server: Server, label: str) -> None:
    if not options.quiet:
        print(label)
        print(f"open {server.app_url}")
        print(f"or in Foxglove: Open connection, ws://{options.host or _HOST}:{server.port}; Ctrl-C ends", flush=True)


def _summarise(options: argparse.Namespace, samples: int) -> None:
    if not options.quiet:
        print(f"{counted(samples, 'sample')} shown")


def _warn(text: str) -> None:
    print(f"warning: {text}", file=sys.stderr, flush=True)
