"""Tests of hostile values and buffers: EncodeError names the field, DecodeError, and threads."""

from __future__ import annotations

import re
import subprocess
import sys
from array import array
from collections import OrderedDict, deque
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from support.catalogs import catalog_of, import_package
from support.random_definitions import TOLERATED
from support.repository import ROOT

FILES = {
    "msg/Few.msg": "uint64 timestamp\nfloat32[3] few\nbool[3] flags\n",
    "msg/Fleet.msg": "Few[2] wings\n",
    "msg/Free.msg": "float32[] many\nuint8[] raw\n",
    "msg/Many.msg": "uint64 timestamp\nfloat32[20] many\n",
    "msg/Named.msg": "string name\nstring<=5 short\nfloat32[3] few\n",
}


class Lying(list[float]):
    """A list with another length than its elements."""

    def __len__(self) -> int:
        return 20


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("hostile")
    return import_package(catalog_of(folder / "in", FILES, TOLERATED), folder)


NO_SEQUENCES: dict[str, Any] = {
    "a set": set(range(20)),
    "a frozenset": frozenset(range(20)),
    "a dict": dict.fromkeys(range(20)),
    "an OrderedDict": OrderedDict.fromkeys(range(20)),
    "keys": dict.fromkeys(range(20)).keys(),
    "bytes": bytes(20),
    "a bytearray": bytearray(20),
    "text": "1" * 20,
    "an iterator": iter([1.0] * 20),
    "a generator": (1.0 for _ in range(20)),
    "an endless iterator": count(),
    "an array of 0 dimensions": np.array(1.0),
    "an array of 2 dimensions": np.ones((20, 1)),
    "a view of 2 dimensions": memoryview(bytes(20)).cast("B", (4, 5)),
    "a long range": range(10**9),
    "a list of another length": Lying([1.0]),
}
SEQUENCES: dict[str, Any] = {
    "a list": [1.0] * 20,
    "a tuple": (1.0,) * 20,
    "a deque": deque([1.0] * 20),
    "a range": range(20),
    "an array": array("d", [1.0] * 20),
    "a view": memoryview(array("f", [1.0] * 20)),
    "an array of numpy": np.ones(20, np.float32),
    "an array of numpy, of another type": np.ones(20, np.int16),
}


@pytest.mark.parametrize("value", NO_SEQUENCES.values(), ids=NO_SEQUENCES.keys())
def test_what_is_no_sequence_is_an_error_that_names_the_field(value: Any, package: Any) -> None:
    with pytest.raises(package.EncodeError, match=r"^Many\.many: expected "):
        package.Many(many=value).encode()


@pytest.mark.parametrize("kind", [kind for kind in NO_SEQUENCES if kind != "a long range"])
def test_what_is_no_sequence_is_no_sequence_of_any_length(kind: str, package: Any) -> None:
    with pytest.raises(package.EncodeError, match=r"^Free\.many: expected "):
        package.Free(many=NO_SEQUENCES[kind]).encode()


@pytest.mark.parametrize("value", SEQUENCES.values(), ids=SEQUENCES.keys())
def test_every_kind_of_sequence_is_accepted(value: Any, package: Any) -> None:
    assert list(package.Many.decode(package.Many(many=value).encode()).many) == [float(one) for one in value]
    assert list(package.Free.decode(package.Free(many=value).encode()).many) == [float(one) for one in value]


FEW: dict[str, Any] = {
    "a set": {0, 1, 2},
    "a frozenset": frozenset({0, 1, 2}),
    "a dict": {0: 0, 1: 0, 2: 0},
    "keys": {0: 0, 1: 0, 2: 0}.keys(),
    "bytes": bytes(3),
    "a bytearray": bytearray(3),
    "a generator": (1.0 for _ in range(3)),
    "an array of 2 dimensions": np.ones((3, 1)),
}


@pytest.mark.parametrize("value", FEW.values(), ids=FEW.keys())
def test_a_small_array_is_a_sequence_too(value: Any, package: Any) -> None:
    for message, path in (
        (package.Few(few=value), "Few.few"),
        (package.Fleet(wings=(package.Few(), package.Few(few=value))), "Fleet.wings[1].few"),
        (package.Named(name="a", few=value), "Named.few"),
    ):
        with pytest.raises(package.EncodeError, match=rf"^{re.escape(path)}: expected 3 values, got "):
            message.encode()


def test_a_small_array_of_bools_is_a_sequence_too(package: Any) -> None:
    for value in ({False, True, 2}, b"\0\1\0", {0: 1, 1: 1, 2: 2}):
        with pytest.raises(package.EncodeError, match=r"^Few\.flags: expected 3 values, got "):
            package.Few(flags=value).encode()


@pytest.mark.parametrize("value", [[1, 0, 1], deque([1, 0, 1]), array("f", [1, 0, 1]), np.array([1.0, 0, 1])])
def test_a_small_array_is_any_sequence(value: Any, package: Any) -> None:
    for cls in (package.Few, package.Named):
        assert cls.decode(cls(few=value).encode()).few == (1.0, 0.0, 1.0)
    assert package.Few.decode(package.Few(flags=[True, False, True]).encode()).flags == (True, False, True)


class Text(str):
    """A text whose own methods are of no use."""

    __slots__ = ()

    def encode(self, *_: Any) -> bytes:
        return bytes(5)

    def __len__(self) -> int:
        return 1


def test_the_methods_of_a_text_are_not_called(package: Any, px4_types: Any) -> None:
    with pytest.raises(px4_types.EncodeError, match=r"got 'abc': use its \.encode\(\)\.ljust\(10, "):
        px4_types.DebugArray(name=Text("abc")).encode()
    with pytest.raises(package.EncodeError, match="expected up to 5 characters, got 6"):
        package.Named(short=Text("abcdef")).encode()
    with pytest.raises(package.EncodeError, match="unpaired surrogate at index 1"):
        package.Named(name=Text("a\ud800")).encode()
    assert package.Named.decode(package.Named(name=Text("abc")).encode()).name == "abc"


def outcome(message: Any) -> str:
    """Return the error of a message that cannot be encoded, or "encoded"."""
    try:
        sample = message.encode()
    except ValueError as error:
        return str(error)
    assert type(message).decode(sample).encode() == sample
    return "encoded"


OWN = {str: "abc", bytes: b"abc", bytearray: b"abc", int: 1, float: 0.5, list: [1.0], tuple: (1.0,)}
KEPT = {"__new__", "__init__", "__getnewargs__", "__init_subclass__", "__subclasshook__"}


@pytest.mark.parametrize("error", [TypeError, ZeroDivisionError, KeyError, RuntimeError])
@pytest.mark.parametrize("base", OWN)
def test_a_class_can_override_any_method(base: type[Any], error: type[Exception], package: Any, px4_types: Any) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    for method in {*dir(base), "__index__", "__buffer__"} - KEPT:
        value = type("Altered", (base,), {method: property(fail) if method == "__class__" else fail})(OWN[base])
        for message, path in (
            (px4_types.DebugArray(name=value), "DebugArray.name"),
            (package.Few(timestamp=value), "Few.timestamp"),
            (package.Few(few=value), "Few.few"),
            (package.Few(flags=value), "Few.flags"),
            (package.Fleet(wings=value), "Fleet.wings"),
            (package.Free(raw=value), "Free.raw"),
            (package.Free(many=value), "Free.many"),
            (package.Many(many=value), "Many.many"),
            (package.Named(name=value), "Named.name"),
            (package.Named(short=value), "Named.short"),
        ):
            assert outcome(message).startswith((f"{path}: expected ", "encoded"))


NO_BYTES = (
    array("b", [-1]),
    memoryview(bytes(4)).cast("B", (2, 2)),
    np.ones(2, np.int8),
    np.datetime64(1, "s"),  # its buffer is one of bytes
)


@pytest.mark.parametrize("value", NO_BYTES)
def test_only_a_buffer_of_bytes_is_bytes(value: Any, package: Any) -> None:
    with pytest.raises(package.EncodeError, match=r"^Free\.raw: expected bytes"):
        package.Free(raw=value).encode()


def test_a_large_array_is_named_without_its_values(px4_types: Any) -> None:
    shown: list[str] = []

    class Large(np.ndarray[Any, Any]):
        def __repr__(self) -> str:
            shown.append("repr")
            return "values"

    for number, text in ((1, "values"), (70_000, "Large of 560000 bytes")):
        with pytest.raises(px4_types.EncodeError, match=f"junk: expected 512 bytes, got {text}"):
            px4_types.OrbTestLarge(junk=np.zeros(number).view(Large)).encode()
    assert shown == ["repr"]


@pytest.mark.parametrize("name", ["EscStatus", "SensorCombined"])
@pytest.mark.parametrize("method", ["decode", "lazy"])
def test_lengths_of_buffers_count_bytes(name: str, method: str, px4_types: Any) -> None:
    cls = getattr(px4_types, name)
    read = getattr(cls, method)
    sample = cls(timestamp=7).encode()
    for surplus in range(4):
        padded = sample + bytes(surplus)
        assert read(padded).timestamp == read(bytearray(padded)).timestamp == read(memoryview(padded)).timestamp == 7
    long = sample + bytes(3 * len(sample))
    with pytest.raises(px4_types.DecodeError):
        read(memoryview(long).cast("I"))
    aligned = sample + bytes(-len(sample) % 4)
    assert read(memoryview(aligned).cast("I")).timestamp == 7
    gaps: Any = np.frombuffer(bytes(byte for value in sample for byte in (value, 0)), np.uint8)[::2]
    assert read(gaps).timestamp == read(memoryview(gaps)).timestamp == 7
    for invalid in (gaps[:40], np.array(5, np.uint8)):
        with pytest.raises(px4_types.DecodeError):
            read(invalid)


PROGRAM = """
import sys, threading
sys.path.insert(0, sys.argv[1]); sys.setswitchinterval(1e-6)
import px4_types
from px4_types import EscStatus
THREADS = 16
barrier, found, errors = threading.Barrier(THREADS), [], []
def work():
    try:
        barrier.wait()
        import dataclasses
        fields = dataclasses.fields(EscStatus)
        assert dataclasses.replace(EscStatus()) == EscStatus() and dataclasses.asdict(EscStatus())
        found.append((id(EscStatus.__msg__), id(fields[0]), id(px4_types.SensorCombined), id(px4_types.topics)))
        EscStatus.lazy(EscStatus().encode()).timestamp
    except BaseException as error:
        errors.append(repr(error))
threads = [threading.Thread(target=work) for _ in range(THREADS)]
for thread in threads: thread.start()
for thread in threads: thread.join()
print(errors, len(set(found)), len(found))
"""


@pytest.mark.parametrize("number", range(3))
def test_all_threads_get_the_same_objects(number: int) -> None:
    command = [sys.executable, "-c", PROGRAM, str(ROOT / "generated"), str(number)]
    done = subprocess.run(command, cwd=Path.cwd(), capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout == "[] 1 16\n"
