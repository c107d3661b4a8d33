"""The first words between a program and the process that owns its link."""

from __future__ import annotations

import itertools
import os
import socket
import sys
import time
from collections.abc import Sequence
from typing import Any

from msggen.base.checked import UnexpectedError
from msggen.base.version import __version__
from msggen.link.address import parse_address
from msggen.link.link import LinkError
from msggen.vehicle.owned.places import found_at
from msggen.vehicle.owned.records import EVENT, HEADER, LONGEST, PROTOCOL, RecordError, event_in, event_of
from msggen.vehicle.owned.told import checked_event

_HELLO_S = 10.0
"""The longest wait in s for its first one, and for a place among its programs."""
_AGAIN_S = 0.02


class LeavingError(LinkError):
    """The owner ends: it was killed, or it makes room for one of this version of msggen."""


def connected(path: str) -> socket.socket:
    """Return a socket that is connected to the owner at a path.

    Raises OSError if nobody listens there, and LinkError if no further program is taken within 10 s.
    """
    own = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        own.settimeout(0.0)  # a blocking one would wait for ever while many others wait
        _connect(own, path)
        own.settimeout(None)
    except BaseException:
        own.close()
        raise
    return own


def _connect(own: socket.socket, path: str) -> None:
    end = time.monotonic() + _HELLO_S
    while time.monotonic() < end:
        try:
            own.connect(path)
        except BlockingIOError:
            time.sleep(_AGAIN_S)
        else:
            return
    raise LinkError(
        f"the process that owns the link at '{path}' takes no further program: end some of those that use it, or see "
        "its log"
    )


def greeted(own: socket.socket, address: str, allow: Sequence[str | int] = (), name: str = "") -> socket.socket:
    """Return a socket once its owner has welcomed this program, which wants a link of this address and these settings.

    Raises LeavingError, and LinkError with what to do.
    """
    hello = {
        "protocol": PROTOCOL,
        "version": __version__,
        "pid": os.getpid(),
        "name": name or _own_name(),
        "address": address,
        "place": found_at(parse_address(address)) if address else "",
        "allow": list(allow),
        "is_program": True,
    }
    try:
        own.settimeout(_HELLO_S)
        own.sendall(event_of("hello", hello))
        event, values = _first_event(own)
        values = checked_event(event, values)
    except (TimeoutError, RecordError, UnexpectedError) as error:
        own.close()
        raise LinkError(f"the process that owns the link does not answer: {error}") from None
    except OSError as error:  # it was killed, or ends
        own.close()
        raise LeavingError(f"the process that owns the link has ended: {error}") from None
    if event != "welcome":
        own.close()
        if event == "leaving":
            raise LeavingError("the process that owns the link ends, because it is of another version of msggen")
        if event == "refused":
            raise LinkError(values[0])
        raise LinkError("the process that owns the link does not answer: it has not greeted this program")
    own.settimeout(None)
    return own


def _first_event(own: socket.socket) -> tuple[str, list[Any]]:
    """Read the first record, and nothing behind it."""
    header = _exactly(own, HEADER.size)
    kind, *_, length = HEADER.unpack(header)
    if kind != EVENT or length > LONGEST:
        raise RecordError("bytes that are no record")
    return event_in(_exactly(own, length))


def _exactly(own: socket.socket, size: int) -> bytes:
    data, end = b"", time.monotonic() + _HELLO_S
    while len(data) < size:
        chunk = own.recv(size - len(data))
        if not chunk or time.monotonic() > end:
            raise OSError("it has closed the connection")
        data += chunk
    return data


def _own_name() -> str:
    """Return the name of this program for people: `msggen topic echo`, or that of its file."""
    program = os.path.basename(sys.argv[0] or "python")
    if program in {"msggen", "__main__.py"}:
        return " ".join(["msggen", *itertools.takewhile(lambda word: not word.startswith("-"), sys.argv[1:3])])
    return program
