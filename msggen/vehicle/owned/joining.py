"""The link of an address, in a process that owns it for all programs: it is joined, or started if there is none."""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import NamedTuple

from msggen.base.interpreter import command_of
from msggen.link.address import Address
from msggen.link.link import LinkError
from msggen.vehicle.owned.greeting import LeavingError, connected, greeted
from msggen.vehicle.owned.places import Place, place_of
from msggen.vehicle.owned.unix import UnixLink

START_S = 60.0
"""The longest wait in s for an owner to start."""

_OWNER = "msggen.vehicle.owner.process"
_NOTHING: Mapping[str, object] = MappingProxyType({})
_ATTEMPTS = 20
"""How often a program looks for an owner again that has just ended, or that makes room for another one."""
_LINES = 5
"""The lines of the log of an owner that an error shows."""


class Wanted(NamedTuple):
    """A link that a program wants."""

    address: Address
    allow: tuple[str | int, ...] = ()


class SharedLink(UnixLink):
    """The link of an address, owned by a process of its own. If that ends, it is joined or started again."""

    def __init__(self, address: Address, allow: Sequence[str | int] = ()) -> None:
        """Make a link. Raises LinkError if there is no place for its socket."""
        self._place = place_of(address)
        super().__init__(self._place.socket)
        self._wanted = Wanted(address, tuple(allow))

    def connect(self) -> socket.socket:
        """Join the owner, or start one. Raises LinkError."""
        return joined(self._place, self._wanted)

    def reopened(self, reason: str) -> socket.socket:  # noqa: ARG002
        """Join the next owner, or start one. Raises LinkError."""
        return self.connect()


def joined(place: Place, wanted: Wanted) -> socket.socket:
    """Return a socket whose owner has welcomed this program. Raises LinkError."""
    for attempt in range(_ATTEMPTS):
        with suppress(OSError, LeavingError):
            return greeted(connected(place.socket), str(wanted.address), wanted.allow)
        if attempt:
            time.sleep(0.01 * attempt)
        with alone(place):
            if not _is_served(place):
                start_owner(place, wanted)
    raise LinkError(f"the process that owns {wanted.address} ends again and again{_last_lines(place)}")


def _is_served(place: Place) -> bool:
    with suppress(OSError):
        connected(place.socket).close()
        return True
    return False


@contextmanager
def alone(place: Place) -> Iterator[None]:
    """Keep other programs from starting an owner meanwhile. Raises LinkError."""
    import fcntl

    end = time.monotonic() + START_S
    with open(place.start, "ab") as file:
        while True:
            with suppress(BlockingIOError):
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            if time.monotonic() > end:
                raise LinkError(f"another program starts the link, for more than {START_S:g} s: see '{place.log}'")
            time.sleep(0.005)
        yield


def start_owner(
    place: Place, wanted: Wanted, *, stays: bool = False, module: str = _OWNER, further: Mapping[str, object] = _NOTHING
) -> None:
    """Start a process that owns a link, and wait until programs can join it. Raises LinkError with its reason.

    With `stays`, it does not end by itself when nobody uses it. `module` is another one to run, and `further` what its
    setup has for it.
    """
    command = command_of(module)
    if not command[0]:
        raise LinkError("the program of Python is not known: own the link, MSGGEN_DIRECT=1")
    setup = {
        "address": str(wanted.address),
        "allow": list(wanted.allow),
        "place": list(place),
        "stays": stays,
        **further,
    }
    try:
        process = subprocess.Popen(  # noqa: S603 - our own program
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, cwd="/"
        )
    except OSError as error:
        raise LinkError(f"the process of the link cannot be started: {error}") from error
    with process:  # which ends at once: the owner is its child
        assert process.stdin is not None  # noqa: S101 - it is a pipe
        assert process.stdout is not None  # noqa: S101 - it is a pipe
        with suppress(BrokenPipeError):
            process.stdin.write(json.dumps(setup).encode())
            process.stdin.close()
        told = _told(process.stdout.fileno())
    if not told:
        raise LinkError(f"the process of the link did not start{_last_lines(place)}")
    problem, number = json.loads(told)
    if problem:
        raise LinkError(problem) from (OSError(number, problem) if number else None)


def _told(pipe: int) -> bytes:
    """Return what an owner tells of its start, or nothing if it does not get so far."""
    data, end = b"", time.monotonic() + START_S
    while select.select([pipe], [], [], max(0.0, end - time.monotonic()))[0]:
        chunk = os.read(pipe, 4096)
        data += chunk
        if not chunk or data.endswith(b"\n"):
            break
    return data


def _last_lines(place: Place) -> str:
    """Return the end of the log of an owner, for an error."""
    with suppress(OSError), open(place.log, encoding="utf-8", errors="replace") as file:
        lines = file.read()[-4096:].splitlines()[-_LINES:]
        return f". The last lines of '{place.log}':\n" + "\n".join(lines)
    return ""
