"""Samples of every message, with random values or changed, in buffers of every kind.

`decode` gives a message or DecodeError, as the slow codec of reference.py does, and the message encodes as there.
Lazy views and batches agree with `decode`.
"""

from __future__ import annotations

import importlib
import mmap
import tempfile
from array import array
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np

from msggen.definitions.model import Message
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package
from support.other_codecs import Generated, everything
from support.random_definitions import random_catalog, values_of
from support.reference import HEADERS, MalformedError, deserialize, serialize
from support.samples import plain

COUNT = 6000

LARGE = (0, 1, 5, 2**16, 2**31 - 1, 2**31, 2**32 - 4, 2**32 - 1)


class Case(NamedTuple):
    """A sample of a message in a kind of buffer."""

    message: str
    sample: bytes
    buffer: str


class Target(NamedTuple):
    """A message, its class, and the package that it is of."""

    codec: Generated
    message: Message
    cls: Any


@cache
def targets() -> dict[str, Target]:
    """Return the messages of the committed package, and random ones with strings and sequences, by name."""
    embedded = Generated(read_catalog(find_sources(None)), importlib.import_module("px4_types"))
    folder = Path(tempfile.mkdtemp())
    catalog = random_catalog(folder, Random(0), 60, 5)  # noqa: S311 - not used for security
    made = Generated(catalog, import_package(catalog, folder))
    found = {}
    for codec, label in ((embedded, ""), (made, "random ")):
        for message in everything(codec.catalog):
            found[f"{label}{message.key}"] = Target(codec, message, codec.cls(message))
    return found


def case(chance: Random) -> Case:
    name = chance.choice(list(targets()))
    target = targets()[name]
    encoding = chance.choice((*HEADERS, ("little", 1), ("little", 1)))
    size = target.cls.__msg__.cdr_size
    if size is not None and chance.random() < 0.4:
        sample = HEADERS[encoding] + chance.randbytes(max(0, size + chance.choice((-4, -1, 0, 0, 0, 1, 2, 3, 4, 9))))
    else:
        catalog = target.codec.catalog
        sample = serialize(catalog, target.message, values_of(catalog, target.message, chance), *encoding)
        sample += chance.randbytes(chance.choice((0, 0, 0, 1, 2, 3, 4, 8)))
    if chance.random() < 0.7:
        sample = _changed(chance, sample, encoding[0])
    return Case(name, sample, chance.choice(list(BUFFERS)))


def _changed(chance: Random, sample: bytes, order: Any) -> bytes:
    """Return a sample that is cut off, or in which a count, a bit or a byte differs."""
    kind = chance.random()
    position = chance.randrange(len(sample))
    if kind < 0.2:
        return sample[:position]
    if kind < 0.6:
        given = int.from_bytes(sample[position : position + 4], order)
        number = chance.choice((*LARGE, given + 1, given - 1, len(sample), len(sample) // 4)) % 2**32
        return sample[:position] + number.to_bytes(4, order) + sample[position + 4 :]
    changed = bytearray(sample)
    for _ in range(chance.randint(1, 4)):
        changed[chance.randrange(len(sample))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def check(case: Case) -> None:
    target = targets()[case.message]
    expected = outcome(deserialize, target.codec.catalog, target.message, case.sample)
    found = outcome(target.codec.decode, target.message, case.sample)
    assert found == expected
    in_buffer, is_plain = BUFFERS[case.buffer]
    buffer = in_buffer(case.sample)
    if buffer is None:
        return
    for name, decode in (("decode", target.cls.decode), ("lazy", target.cls.lazy)):
        if name == "lazy" and not hasattr(target.cls, "__layout__"):
            continue
        value = outcome(lambda decode=decode: plain(decode(buffer)))
        wanted = outcome(lambda: plain(target.cls.decode(case.sample)))
        assert value == wanted or (value is None and not is_plain), (name, value, wanted)
    if expected is not None:
        check_message(target, case.sample)
    if hasattr(target.cls, "__layout__"):
        check_batch(target, case.sample)


def outcome(decode: Callable[..., Any], *arguments: Any) -> str | None:
    """Return what `decode` gives as text, None if it refuses the sample."""
    try:
        return repr(decode(*arguments))
    except MalformedError:
        return None
    except ValueError as error:
        if type(error).__name__ != "DecodeError":
            raise
        return None


def check_message(target: Target, sample: bytes) -> None:
    """Check that what a valid sample decodes to encodes as in reference.py, in every encoding."""
    catalog, message = target.codec.catalog, target.message
    decoded = target.cls.decode(sample)
    assert repr(target.cls.decode(sample + b"\xa5" * 9, allow_surplus=True)) == repr(decoded)
    values = target.codec.decode(message, sample)
    for order, version in HEADERS:
        encoded = target.codec.encode(message, values, order, version)
        assert_same(encoded, serialize(catalog, message, values, order, version), target)
    assert_same(decoded.encode(), serialize(catalog, message, values, "little", 1), target)
    assert decoded == target.cls.decode(decoded.encode())


def assert_same(found: bytes, expected: bytes, target: Target) -> None:
    """Check that two samples are the same; the bits of a NaN may differ, because Python does not keep them."""
    if found != expected:
        values, wanted = (repr(deserialize(target.codec.catalog, target.message, each)) for each in (found, expected))
        assert "nan" in wanted, (found.hex(" "), expected.hex(" "))
        assert (values, len(found)) == (wanted, len(expected))


def check_batch(target: Target, sample: bytes) -> None:
    """Check that batches agree with `decode`: a list of samples, a buffer of samples, rows and encoded rows."""
    cls = target.cls
    expected = outcome(lambda: plain(cls.decode(sample)))
    assert outcome(lambda: plain(cls.decode_batch([sample])[0])) == expected
    if expected is None:
        return
    rows = cls.decode_batch(iter([sample, bytearray(sample)]))
    assert outcome(lambda: plain(cls.from_row(rows[1]))) == expected
    encoded = cls.decode(sample).encode()
    assert_same(cls.encode_batch(rows)[0], encoded, target)
    assert plain(cls.decode_batch(encoded * 3)[2]) == plain(cls.decode(encoded))


def _in_mmap(sample: bytes) -> Any:
    if not sample:
        return None
    found = mmap.mmap(-1, len(sample))
    found[:] = sample
    return found


def _cast(code: Any) -> Callable[[bytes], Any]:
    """Return a function that gives a view with the format `code`, None for a sample that does not divide evenly."""

    def in_view(sample: bytes) -> Any:
        return memoryview(sample).cast(code) if len(sample) % array(code).itemsize == 0 else None

    return in_view


def _in_array(code: str) -> Callable[[bytes], Any]:
    def in_array(sample: bytes) -> Any:
        return array(code, sample) if len(sample) % array(code).itemsize == 0 else None

    return in_array


def _in_numpy(type_: str) -> Callable[[bytes], Any]:
    def in_numpy(sample: bytes) -> Any:
        return np.frombuffer(sample, type_) if len(sample) % np.dtype(type_).itemsize == 0 else None

    return in_numpy


def _in_columns(sample: bytes) -> Any:
    return memoryview(sample).cast("B", (len(sample) // 4, 4)) if sample and len(sample) % 4 == 0 else None


def _in_2d(sample: bytes) -> Any:
    return np.frombuffer(sample, np.uint8).reshape(-1, 2) if len(sample) % 2 == 0 else None


BUFFERS: dict[str, tuple[Callable[[bytes], Any], bool]] = {
    "bytes": (bytes, True),
    "bytearray": (bytearray, True),
    "memoryview": (memoryview, True),
    "mmap": (_in_mmap, True),
    **{f"view of {code}": (_cast(code), True) for code in "bhHiIqQfd"},
    **{f"array of {code}": (_in_array(code), True) for code in "bBhHiIqQfd"},
    **{f"numpy {type_}": (_in_numpy(type_), True) for type_ in ("u1", "i1", "<u2", ">i4", "f4", "<f8", "V2", "S3")},
    "view in two dimensions": (_in_columns, True),
    "numpy in two dimensions": (_in_2d, True),
    "every second byte": (lambda sample: memoryview(bytes(each for byte in sample for each in (byte, 0)))[::2], False),
    "backwards": (lambda sample: memoryview(sample[::-1])[::-1], False),
    "numpy, every second byte": (lambda sample: np.repeat(np.frombuffer(sample, np.uint8), 2)[::2], False),
    "numpy, transposed": (lambda sample: None if (view := _in_2d(sample)) is None else np.asfortranarray(view), False),
}
"""Functions that put a sample into a buffer, None if it does not fit, and whether `decode` must read the buffer.

A buffer with gaps may be refused with DecodeError.
"""
