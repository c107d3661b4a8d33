"""The measured messages: eleven of the embedded PX4 v1.18, each with one sample from the tests' vectors.

The values are random, with finite floats; the firmware's own serializer wrote the samples.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from environment import ROOT
from msggen.definitions.layout import lay_out
from msggen.definitions.model import Catalog, Message
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources

GENERATED = ROOT / "generated"
VECTORS = ROOT / "tests" / "vectors" / "cdr.json"
RANDOM = 1
"""The variant of the vectors whose values are random and finite."""

HEADER = b"\0\1\0\0"
MESSAGES = (
    "SensorCombined",
    "TrajectorySetpoint",
    "VehicleStatus",
    "VehicleOdometry",
    "VehicleLocalPosition",
    "GpsDump",
    "ObstacleDistance",
    "DebugArray",
    "PositionSetpointTriplet",
    "EscStatus",
    "OrbTestLarge",
)
"""Names of the messages: plain ones, with many bools, with small and large arrays, and with nested messages."""

NESTED = ("PositionSetpointTriplet", "EscStatus")


class Sample(NamedTuple):
    """One message: its definition, and the bytes of a sample with padding zero."""

    catalog: Catalog
    message: Message
    payload: bytes

    @property
    def name(self) -> str:
        """The name of the message."""
        return self.message.name

    @property
    def nested(self) -> tuple[Message, ...]:
        """The nested messages."""
        return self.catalog.nested_all(self.message)

    def definition(self) -> str:
        """Return the definition as text, followed by those of nested messages, as in recordings."""
        parts = [
            fields_text(self.message),
            *(f"MSG: {inner.package}/{inner.name}\n{fields_text(inner)}" for inner in self.nested),
        ]
        return f"{'=' * 80}\n".join(parts)

    def varied(self, count: int) -> list[bytes]:
        """Return `count` samples that differ in their timestamp, the first field of all messages."""
        start = len(HEADER)
        return [
            HEADER + struct.pack("<Q", number) + self.payload[start + 8 :] for number in range(2**40, 2**40 + count)
        ]


def fields_text(message: Message) -> str:
    """Return the fields of one message as definition text."""
    return "".join(f"{field.type} {field.name}\n" for field in message.fields)


def read_samples(names: Sequence[str] = MESSAGES) -> list[Sample]:
    """Return a sample of each of the messages."""
    catalog = read_catalog(find_sources(None))
    vectors = json.loads(VECTORS.read_text())
    stale = {vector["type"]: bytes.fromhex(vector["hex"]) for vector in vectors if vector["variant"] == RANDOM}
    messages = [catalog.messages[f"px4_msgs/{name}"] for name in names]
    return [Sample(catalog, message, HEADER + _clean(catalog, message, stale[message.name])) for message in messages]


def _clean(catalog: Catalog, message: Message, stale: bytes) -> bytes:
    values = set(_positions(catalog, message))
    return bytes(byte if position in values else 0 for position, byte in enumerate(stale))


def _positions(catalog: Catalog, message: Message) -> Iterator[int]:
    for leaf in lay_out(catalog, message).leaves:
        yield from range(leaf.offset, leaf.offset + leaf.element_count * leaf.size)
