"""Records on the socket between the process that owns a link and a program that uses it: docs/links.md.

A record is a header and a body. Samples and requests have their payload as body; all else is JSON, a list of a name and
its values. The names of what happens on a link are the methods of its listener.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

from msggen.link.link import Remote, Route, Service

PROTOCOL = 5
"""The version of these records. Both sides tell it first; programs with another one use a link of their own."""

HEADER = struct.Struct("<BIHqI")
"""The kind, the number of the vehicle, the index of its route or service, the time in ns or the number of a call, and
the size of the body. In a sample to a vehicle, the time is that until which it may be sent, of the owner's clock."""

UNTIL = struct.Struct("<q")
"""What precedes the payload of a request: the time until which its caller waits, of the owner's clock."""

SAMPLE, EVENT, CALL, LAST = range(4)
"""The kinds: a sample; JSON; a request or a reply; the last sample of a route, without a body if there is none yet."""

LONGEST = 1 << 20
"""The bytes of the longest body."""

Record: TypeAlias = tuple[int, int, int, int, bytes]
"""Kind, number of the vehicle, index, time or number, and body."""


class RecordError(ValueError):
    """Bytes that are no record."""


class KnownVehicle(NamedTuple):
    """A connected vehicle. Its routes and services have the same indexes on both sides of the socket."""

    remote: Remote
    routes: list[Route]
    services: list[Service]
    indexes: dict[str, int]
    """Of the routes, by name."""

    @staticmethod
    def of(remote: Remote) -> KnownVehicle:
        """Return a vehicle without routes."""
        return KnownVehicle(remote, [], [], {})

    def add(self, route: Route | Service) -> None:
        """Add a route or a service."""
        if isinstance(route, Service):
            self.services.append(route)
        elif route.name in self.indexes:  # created again
            self.routes[self.indexes[route.name]] = route
        else:
            self.indexes[route.name] = len(self.routes)
            self.routes.append(route)


def record_of(kind: int, body: bytes, vehicle: int = 0, index: int = 0, when: int = 0) -> bytes:
    """Return a record as bytes."""
    return HEADER.pack(kind, vehicle, index, when, len(body)) + body


def event_of(name: str, *values: object) -> bytes:
    """Return a record with JSON."""
    return record_of(EVENT, json.dumps([name, *values], separators=(",", ":")).encode())


def event_in(body: bytes) -> tuple[str, list[Any]]:
    """Return the name and the values in a record with JSON. Raises RecordError."""
    try:
        event = json.loads(body)
    except (ValueError, RecursionError):
        raise RecordError("a record without JSON") from None
    if not isinstance(event, list) or not event or not isinstance(event[0], str):
        raise RecordError("a record without the name of an event")
    return event[0], event[1:]


class RecordReader:
    """The records in a stream of bytes that arrives in pieces."""

    def __init__(self, longest: int = LONGEST) -> None:
        self._data = b""
        self._longest = longest

    def add(self, chunk: bytes) -> Iterator[Record]:
        """Yield the records that are whole with some further bytes. Raises RecordError."""
        data, size, position = self._data + chunk, HEADER.size, 0
        end = len(data)
        while position + size <= end:
            kind, vehicle, index, when, length = HEADER.unpack_from(data, position)
            if kind > LAST or length > self._longest:
                raise RecordError("bytes that are no record")
            body = position + size
            if body + length > end:
                break
            position = body + length
            yield kind, vehicle, index, when, data[body:position]
        self._data = data[position:]
