"""Records in the pipes between a program and the process of its link."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import IO, NamedTuple, TypeAlias

from msggen.live.link import Remote, Route, Service

HEADER = struct.Struct("<BIHqI")
"""The kind, the number of the vehicle, the index of its route or service, the time in ns or the number of a call, and
the size of the body."""

SAMPLE, EVENT, CALL = range(3)
"""The kinds: a sample; an event or a setup, as JSON; a request or a reply."""

Record: TypeAlias = tuple[int, int, int, int, bytes]
"""Kind, number of the vehicle, index, time or number, and body."""

_CHUNK = 1 << 18


class KnownVehicle(NamedTuple):
    """A connected vehicle. Its routes and services have the same indexes on both sides of the pipes."""

    remote: Remote
    routes: list[Route]
    services: list[Service]
    indexes: dict[str, int]
    """Of the routes, by name."""


def record_of(kind: int, body: bytes, remote: int = 0, index: int = 0, when: int = 0) -> bytes:
    """Return a record as bytes."""
    return HEADER.pack(kind, remote, index, when, len(body)) + body


def records_of(stream: IO[bytes]) -> Iterator[Record]:
    """Yield the records in a pipe, until the other side closes it. An incomplete one at the end is left out."""
    data, size = b"", HEADER.size
    while chunk := os.read(stream.fileno(), _CHUNK):
        data += chunk
        position, end = 0, len(data)
        while position + size <= end:
            kind, remote, index, when, length = HEADER.unpack_from(data, position)
            body = position + size
            if body + length > end:
                break
            position = body + length
            yield kind, remote, index, when, data[body:position]
        data = data[position:]
