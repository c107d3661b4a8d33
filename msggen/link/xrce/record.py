"""What is written down of a session, so that another program can continue it. docs/xrce.md, 10."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from msggen.link.xrce import wire
from msggen.link.xrce.outbox import Address

_NOTHING: Mapping[str, int] = MappingProxyType({})
_NO_SAMPLES: Mapping[str, tuple[bytes, int]] = MappingProxyType({})


class Record(NamedTuple):
    """A session: all that another agent needs and cannot ask for. The client tells the sequence numbers."""

    address: Address
    key: int
    """UXRCE_DDS_KEY."""
    session_id: int
    mtu: int
    next: int
    """The number of the reliable message that came after the last one in `parts`. Another one has been missed if the
    next CREATE has another number."""
    parts: tuple[bytes, ...]
    """The CREATE and READ_DATA of the client, as submessages in their order. They tell the namespace, too."""
    hashes: Mapping[str, int] = _NOTHING
    """The `message_hash` of the vehicle's definitions by ROS type, as far as they are known."""
    samples: Mapping[str, tuple[bytes, int]] = _NO_SAMPLES
    """The last samples of topics that the vehicle publishes on change only, each with the time of its arrival in ns, by
    the names of their routes."""


class Journal:
    """The CREATE and READ_DATA of a client, as they have arrived, up to a number of bytes."""

    def __init__(self, most: int) -> None:
        self._parts: dict[tuple[int, bytes], bytes] = {}  # the last one for each kind and object, in order
        self._left = most
        self._is_whole = True
        self.version = 0
        """Counts the changes."""

    @property
    def parts(self) -> tuple[bytes, ...] | None:
        """The submessages, or None if they do not tell all entities."""
        return tuple(self._parts.values()) if self._is_whole else None

    def add(self, submessage: wire.Submessage) -> None:
        """Take a CREATE or READ_DATA that was accepted."""
        kind, _, payload = submessage
        old = self._parts.pop((kind, payload[2:4]), b"")
        if self._is_whole:
            self._parts[kind, payload[2:4]] = new = wire.pack_submessage(kind, payload, submessage.flags)
            self._left += len(old) - len(new)
            self.version += 1
        if self._left < 0:
            self.give_up()

    def give_up(self) -> None:
        """Forget all: PX4's client deletes no single entities, and has not so many."""
        self._parts.clear()
        self._is_whole = False
        self.version += 1
