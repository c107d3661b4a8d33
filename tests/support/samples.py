"""Helpers for the tests of batches and lazy views: samples of every message, and one form for comparing values."""

from __future__ import annotations

import importlib
import json
import math
import tempfile
from array import array
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any
from zlib import crc32

import numpy as np
from hypothesis import strategies as st

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES
from support.catalogs import catalog_of, import_package
from support.examples import examples
from support.reference import HEADERS, serialize
from support.repository import SOME, VECTORS
from support.strategies import values_of

ENCODINGS = sorted(HEADERS)
USUAL = ("little", 1)
HEADER = HEADERS[USUAL]

Samples = dict[tuple[str, int], list[bytes]]
"""Samples of one message by encoding, with the same values in each encoding."""

_TYPES = ("bool", *INTEGERS, *FLOATS)

MADE_UP = {
    "msg/Even.msg": "uint64 timestamp\nuint8 a\n",
    "msg/Uneven.msg": "uint8 a\nuint64 timestamp\n",
    "msg/BehindAnOctet.msg": "uint64 timestamp\nuint8 a\nUneven[3] b\nbool c\n",
    "msg/EndsEarly.msg": "uint8 a\nuint64 timestamp\nuint8 b\nEven[2] c\n",
    "msg/EndsEarlyAtOnce.msg": "Even[3] a\nuint64 timestamp\nEven[3] b\n",
    "msg/Bools.msg": "bool a\nbool[20] b\nuint64 timestamp\nbool[1] c\nbool[9] d\n",
    "msg/ManyBools.msg": "uint64 timestamp\nBools[2] a\nBools b\nbool c\n",
    "msg/Octets.msg": "uint8[1] a\nuint64 timestamp\nuint8[7] b\nchar[5] c\nbyte[16] d\nuint8[17] e\n",
    "msg/Ones.msg": "uint64 timestamp\nUneven[1] a\nEven[1] b\n" + "".join(f"{t}[1] one_{t}\n" for t in _TYPES),
    "msg/Large.msg": "uint8 a\n" + "".join(f"{t} one_{t}\n{t}[17] many_{t}\n" for t in _TYPES) + "uint64 timestamp\n",
    "msg/Deep.msg": "uint8 a\nEndsEarly[2] b\nuint64 timestamp\nBehindAnOctet[2] c\nOctets d\n",
    "srv/Tiny.srv": "bool a\n---\nuint8 a\nbool[2] b\n",
    "srv/Bare.srv": "Uneven[2] a\n---\nuint8[6] a\n",
}
"""Messages unlike any in PX4; halves of services need no timestamp, so they can be smaller than any message."""


class MadeUp:
    """The package of MADE_UP, with samples."""

    def __init__(self, folder: Path) -> None:
        self.catalog = catalog_of(folder, MADE_UP)
        self.package = import_package(self.catalog, folder)
        importlib.import_module(f"{self.package.__name__}.srv")

    def cls(self, name: str) -> Any:
        """Return a class; the name of a half of a service is like `Tiny_Request`."""
        service, _, half = name.partition("_")
        return getattr(getattr(self.package.srv, service), half) if half else getattr(self.package, name)

    def samples(self, name: str) -> Samples:
        """Return five samples in every encoding."""
        halves = [half for service in self.catalog.services for half in (service.request, service.response)]
        message = next(found for found in (*self.catalog.messages.values(), *halves) if found.name == name)
        values = [values_by_chance(self.catalog, message, Random(seed)) for seed in range(5)]  # noqa: S311 - not used for security
        return {
            encoding: [serialize(self.catalog, message, one, *encoding) for one in values] for encoding in ENCODINGS
        }


MADE_UP_NAMES = [Path(path).stem for path in MADE_UP if path.endswith(".msg")]
MADE_UP_NAMES += ["Tiny_Request", "Tiny_Response", "Bare_Request", "Bare_Response"]


def samples_of_vectors(catalog: Catalog, path: Path = VECTORS / "cdr.json") -> dict[str, Samples]:
    """Return the firmware's samples by message, with stale memory in padding, and their values in other encodings."""
    found: dict[str, Samples] = {}
    for vector in json.loads(path.read_text()):
        message = catalog.messages[f"px4_msgs/{vector['type']}"]
        samples = found.setdefault(message.name, {encoding: [] for encoding in ENCODINGS})
        for order, version in ENCODINGS:
            given = serialize(catalog, message, vector["values"], order, version)
            stale = HEADER + bytes.fromhex(vector["hex"])
            samples[order, version].append(stale if (order, version) == USUAL else given)
    return found


def random_samples(data: st.DataObject, catalog: Catalog, message: Message) -> Samples:
    """Draw the values of three samples and encode them in every encoding."""
    values = data.draw(st.lists(values_of(catalog, message), min_size=3, max_size=3), label=message.name)
    return {encoding: [serialize(catalog, message, one, *encoding) for one in values] for encoding in ENCODINGS}


def values_by_chance(catalog: Catalog, message: Message, chance: Random) -> dict[str, Any]:
    """Return random values for a message with too many values to draw each from hypothesis."""

    def one(type_: FieldType) -> Any:
        if not type_.is_primitive:
            return values_by_chance(catalog, catalog.nested(message, type_), chance)
        if type_.name == "bool":
            return chance.random() < 0.5
        if type_.name in FLOATS:
            return chance.choice([math.nan, math.inf, -0.0, 0.0, 1.5, -(2.0 ** chance.randint(-120, 120))])
        low, high = PRIMITIVES[type_.name].integer_range
        return chance.choice([low, high, chance.randint(low, high)])

    return {
        field.name: one(field.type)
        if field.type.array is ArrayKind.SCALAR
        else [one(field.type) for _ in range(field.type.length)]
        for field in message.fields
    }


def random_packages(data: st.DataObject, files: dict[str, str]) -> Iterator[tuple[Any, Samples]]:
    """Yield the classes of the package made of `files`, each with samples of random values."""
    with tempfile.TemporaryDirectory() as folder:
        catalog = catalog_of(Path(folder), files)
        package = import_package(catalog, Path(folder))
        for message in catalog.messages.values():
            yield getattr(package, message.name), random_samples(data, catalog, message)


def plain(value: Any) -> Any:
    """Return a message, an array or a part of them as dictionaries, lists and texts of numbers.

    The texts distinguish 0 from False and from -0.0, and NaN equals NaN.
    """
    if isinstance(value, np.void):
        return {name: plain(value[name]) for name in value.dtype.names or ()}
    if hasattr(value, "__match_args__"):
        return {name: plain(getattr(value, name)) for name in value.__match_args__}
    if isinstance(value, (tuple, list, bytes, array, np.ndarray)):
        return [plain(item) for item in value]
    return repr(value.item() if isinstance(value, np.generic) else value)


def outcome(call: Any, *arguments: Any) -> Any:
    """Return the result of a call in the form of `plain`, or its DecodeError or EncodeError as text."""
    try:
        return plain(call(*arguments))
    except ValueError as error:
        return f"{type(error).__name__}: {error}"


def each_byte_changed(sample: bytes) -> list[bytes]:
    """Return a sample for every byte after the encoding, with that byte changed to 0xA5, which makes an odd bool."""
    return [sample[:index] + b"\xa5" + sample[index + 1 :] for index in range(2, len(sample))]


def some_of(name: str, samples: Samples) -> Iterator[list[bytes]]:
    """Yield the samples of a message in all encodings, by day of most messages only in one that its name draws."""
    drawn = crc32(name.encode()) % len(ENCODINGS) if name not in SOME and examples(100) < 100 else None
    yield from (each for place, each in enumerate(samples.values()) if drawn in (None, place))


def cut_and_lengthened(sample: bytes) -> Iterator[bytes]:
    """Yield every prefix of the sample, and the sample with up to 8 more bytes."""
    for length in range(len(sample) + 9):
        yield (sample + b"\xa5" * 8)[:length]
