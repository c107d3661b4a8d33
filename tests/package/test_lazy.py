"""Tests of lazy views: they act like the messages of `decode`, read a field on access, and refuse the same samples.

Also tests of `decode` itself: every length around the size of a sample, and subclasses.
"""

from __future__ import annotations

import copy
import dataclasses
import pickle
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen.definitions.model import Catalog
from support.catalogs import catalog_of, import_package
from support.examples import examples, some
from support.repository import ROOT, SOME, every_message
from support.samples import (
    MADE_UP_NAMES,
    USUAL,
    MadeUp,
    Samples,
    cut_and_lengthened,
    each_byte_changed,
    outcome,
    plain,
    random_packages,
    samples_of_vectors,
    some_of,
)
from support.strategies import definitions


@pytest.fixture(scope="module")
def vectors(embedded: Catalog) -> dict[str, Samples]:
    return samples_of_vectors(embedded)


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> MadeUp:
    return MadeUp(tmp_path_factory.mktemp("made_up"))


def check_views(cls: Any, samples: Samples) -> None:
    """Check that a view of each sample equals the decoded message and has the same values, text and bytes."""
    kinds: list[Any] = [bytes, bytearray, memoryview]
    for several in samples.values():
        messages = [cls.decode(sample) for sample in several]
        for number, (sample, message) in enumerate(zip(several, messages, strict=True)):
            view = cls.lazy(kinds[number % 3](sample + b"\xa5" * (number % 4)))
            assert plain(view) == plain(message)
            assert repr(view) == repr(message)
            assert view.encode() == message.encode()
            assert isinstance(view, cls)
            assert [view == one for one in messages] == [message == one for one in messages]
            assert [one == view for one in messages] == [message == one for one in messages]
            assert view == cls.lazy(sample)


@every_message
def test_views_equal_what_decode_gives(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    check_views(getattr(px4_types, name), vectors[name])


@pytest.mark.parametrize("name", MADE_UP_NAMES)
def test_views_of_unusual_messages_equal_what_decode_gives(name: str, made_up: MadeUp) -> None:
    check_views(made_up.cls(name), made_up.samples(name))


@pytest.mark.slow
@settings(max_examples=examples(15), suppress_health_check=list(HealthCheck))
@given(definitions(), st.data())
def test_views_of_random_messages_equal_what_decode_gives(files: dict[str, str], data: st.DataObject) -> None:
    for cls, samples in random_packages(data, files):
        check_views(cls, samples)


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_each_byte_counts_where_decode_counts_it(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    """The changed bytes include odd bools."""
    cls = getattr(px4_types, name)
    for samples in vectors[name].values():
        for sample in some(each_byte_changed(samples[1]), 3):
            assert outcome(cls.lazy, sample) == outcome(cls.decode, sample)


# Views act like messages

PROGRAM = """
import dataclasses
from px4_types import EscStatus, SensorCombined
view = SensorCombined.lazy(SensorCombined(timestamp=7).encode())
assert {} == {}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "expected"),
    [
        ("dataclasses.asdict(view)", "dataclasses.asdict(SensorCombined(timestamp=7))"),
        ("dataclasses.astuple(view)[0]", "7"),
        ("dataclasses.is_dataclass(view)", "True"),
        ("[field.name for field in dataclasses.fields(view)]", "list(SensorCombined.__match_args__)"),
        ("dataclasses.replace(view, timestamp=8)", "SensorCombined(timestamp=8)"),
        ("dataclasses.asdict(EscStatus.lazy(EscStatus().encode()))['esc'][7]['esc_rpm']", "0"),
    ],
)
def test_dataclasses_take_a_view_before_any_message(first: str, expected: str) -> None:
    """Each case has its own process: dataclasses inspect a class once, so an earlier message could hide an error."""
    command = [sys.executable, "-c", PROGRAM.format(first, expected)]
    done = subprocess.run(command, cwd=ROOT / "generated", capture_output=True, text=True, check=False)
    assert done.stderr == ""


@every_message
def test_tools_of_the_standard_library_take_views(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, sample = getattr(px4_types, name), vectors[name][USUAL][1]
    view, message = cls.lazy(sample), cls.decode(sample)
    assert plain(dataclasses.asdict(view)) == plain(dataclasses.asdict(message))
    changed = dataclasses.replace(view, timestamp=5)
    assert (type(changed), changed) == (cls, dataclasses.replace(message, timestamp=5))
    assert view.__replace__(timestamp=5) == changed
    copies = [copy.copy(view), copy.deepcopy(view)]
    copies += [pickle.loads(pickle.dumps(view, protocol)) for protocol in range(6)]  # noqa: S301 - our own bytes
    for one in copies:
        assert (type(one), plain(one)) == (cls, plain(message))


def test_a_view_decodes_messages_and_knows_its_class(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    view = cls.lazy(cls().encode())
    assert type(view.decode(cls().encode())) is cls
    assert view.__class__ is cls
    assert view.__msg__ is cls.__msg__


@pytest.mark.parametrize("name", SOME)
def test_a_view_can_be_part_of_a_message(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    """The nested views of a view can be parts of other messages."""
    status, report = px4_types.EscStatus, px4_types.EscReport
    views = tuple(report.lazy(report(timestamp=number).encode()) for number in range(12))
    message = status(esc=views)
    assert message == status(esc=tuple(report(timestamp=number) for number in range(12)))
    assert status(esc=status.lazy(message.encode()).esc) == message
    cls, sample = getattr(px4_types, name), vectors[name][USUAL][1]
    view = cls.lazy(sample)
    made = cls(**{field: getattr(view, field) for field in cls.__match_args__})
    assert made.encode() == cls.decode(sample).encode()


def nested_messages(message: Any) -> Iterator[Any]:
    for name in message.__match_args__:
        value = getattr(message, name)
        for one in value if isinstance(value, tuple) else (value,):
            if hasattr(one, "__match_args__"):
                yield one
                yield from nested_messages(one)


@pytest.mark.parametrize("name", ["EscStatus", "PositionSetpointTriplet", "VehicleOdometry"])
def test_views_cannot_be_changed(name: str, px4_types: Any) -> None:
    cls = getattr(px4_types, name)
    view = cls.lazy(cls().encode())
    for one in (view, *nested_messages(view)):
        for field in one.__match_args__:
            with pytest.raises(AttributeError):
                setattr(one, field, getattr(one, field))
            with pytest.raises(AttributeError):
                delattr(one, field)
        with pytest.raises(AttributeError):
            one.something = 1
    assert view == cls()


# Fields are read on access


@every_message
def test_nothing_is_decoded_before_it_is_read(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    """Later changes of the buffer are visible in the view, and in nested views that were taken before."""
    cls, sample = getattr(px4_types, name), vectors[name][USUAL][1]
    buffer = bytearray(cls().encode())
    view = cls.lazy(buffer)
    nested = list(nested_messages(view))
    buffer[:] = sample
    message = cls.decode(sample)
    assert plain(view) == plain(message)
    assert plain(nested) == plain(list(nested_messages(message)))


def test_reading_one_field_does_not_make_the_others(tmp_path: Path) -> None:
    """Blocks of 6000 bytes cannot be decoded without allocating memory for them."""
    files = {
        "msg/Block.msg": "uint64 timestamp\nuint8[6000] a\nfloat32[1500] b\n",
        "msg/Blocks.msg": "Block[3] before\nuint64 timestamp\nBlock after\nfloat32[1500] b\nbool last\n",
    }
    cls = import_package(catalog_of(tmp_path, files), tmp_path).Blocks
    sample = cls(timestamp=7, last=True).encode()
    assert cls.lazy(sample).timestamp == 7
    tracemalloc.start()
    try:
        view = cls.lazy(sample)
        assert (view.timestamp, view.last, view.before[2].timestamp, view.after.timestamp) == (7, True, 0, 0)
        assert tracemalloc.get_traced_memory()[1] < 4_000
        assert len(view.before[1].a) == 6_000
        assert 6_000 < tracemalloc.get_traced_memory()[1] < 10_000
    finally:
        tracemalloc.stop()


# Refused samples


@pytest.mark.slow
@every_message
def test_views_of_every_length_are_made_or_refused_as_decode_does(
    name: str, vectors: dict[str, Samples], px4_types: Any
) -> None:
    cls = getattr(px4_types, name)
    for samples in some_of(name, vectors[name]):
        for sample in cut_and_lengthened(samples[1]):
            assert outcome(cls.lazy, sample) == outcome(cls.decode, sample)
            found = list(ways_to_call(cls, sample, allow_surplus=True))
            assert found == found[:1] * 4


@pytest.mark.parametrize("name", SOME)
def test_views_with_other_headers_are_refused_as_decode_does(
    name: str, vectors: dict[str, Samples], px4_types: Any
) -> None:
    cls, sample = getattr(px4_types, name), vectors[name][USUAL][1]
    for first in range(3):
        for second in range(256):
            other = bytes([first, second]) + sample[2:]
            assert outcome(cls.lazy, other) == outcome(cls.decode, other)


def test_a_buffer_with_gaps_is_read_as_decode_does(px4_types: Any) -> None:
    for name in SOME:
        cls = getattr(px4_types, name)
        spread = memoryview(bytes(byte for value in cls(timestamp=7).encode() for byte in (value, 0xFF)))[::2]
        assert cls.lazy(spread) == cls.decode(spread) == cls(timestamp=7)


# Decoding: each remainder has its own test of the length


def ways_to_call(cls: Any, data: Any, *, allow_surplus: bool) -> Iterator[Any]:
    """Yield the results of `decode` and `lazy`, or their error texts, for every way to pass the option."""
    for call in (cls.decode, cls.lazy):
        yield outcome(call, data, allow_surplus)
        yield outcome(lambda data, call=call: call(data, allow_surplus=allow_surplus), data)
        if not allow_surplus:
            yield outcome(call, data)


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
@pytest.mark.parametrize("octets", [1, 2, 3, 4, 5, 6, 7, 8])
def test_decode_takes_up_to_three_bytes_more_and_none_less(octets: int, kind: Any, tmp_path: Path) -> None:
    files = {"msg/Foo.msg": f"uint64 timestamp\nuint8[{octets}] a\n"}
    package: Any = import_package(catalog_of(tmp_path, files), tmp_path)
    cls, encapsulation = package.Foo, package.encapsulation
    message = cls(2**64 - 1, b"\xfe" * octets)
    for difference in range(-4, 9):
        data = kind((message.encode() + bytes(8))[: 12 + octets + difference])
        field = "" if difference > 0 else ".timestamp" if octets + difference < 0 else ".a"
        refused = (
            (f"DecodeError: Foo{field}: expected {8 + octets} bytes after the header, got {8 + octets + difference}: ")
            + ("" if difference > 0 else "truncated, or of ")
            + encapsulation.OTHER
        )
        without = plain(message) if 0 <= difference <= 3 else refused
        assert list(ways_to_call(cls, data, allow_surplus=False)) == [without] * 6
        with_surplus = plain(message) if difference >= 0 else refused
        assert list(ways_to_call(cls, data, allow_surplus=True)) == [with_surplus] * 4


# Subclasses


@pytest.mark.parametrize("name", SOME)
def test_subclasses_decode_to_themselves(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    parent = getattr(px4_types, name)
    child: Any = type("Child", (parent,), {"__slots__": (), "seconds": property(lambda self: self.timestamp / 1e6)})
    grandchild: Any = type("Grandchild", (child,), {})
    for cls in (child, grandchild):
        for encoding, samples in vectors[name].items():
            array = cls.decode_batch(samples)
            assert array.dtype == parent.dtype()
            for row, sample in zip(array, samples, strict=True):
                expected = parent.decode(sample)
                for found in (cls.decode(sample), cls.lazy(sample), cls.from_row(row)):
                    assert isinstance(found, cls), encoding
                    assert plain(found) == plain(expected)
                    assert found.seconds == expected.timestamp / 1e6
            assert type(cls.decode(samples[0])) is type(cls.from_row(array[0])) is cls
            assert cls.encode_batch(array) == [parent.decode(sample).encode() for sample in samples]
    assert type(parent.decode(vectors[name][USUAL][0])) is parent


def test_a_subclass_that_overrides_decode_calls_the_function_of_its_parent(px4_types: Any) -> None:
    """docs/package.md states this: `decode` is bound to its class."""
    parent = px4_types.VehicleStatus

    class Child(parent):  # type: ignore[misc, valid-type]
        @classmethod
        def decode(cls, data: Any, allow_surplus: Any = False) -> Any:  # noqa: FBT002 - same signature as the parent
            return parent.decode.__func__(cls, data, allow_surplus)

    sample = parent(timestamp=7).encode()
    for data in (sample, sample + b"123", b"\0\0" + sample[2:4] + bytes(7) + b"\7" + sample[12:]):
        assert type(Child.decode(data)) is Child
        assert Child.decode(data).timestamp == 7
    assert np.array_equal(Child.decode_batch([sample]), parent.decode_batch([sample]))


def test_a_subclass_that_overrides_decode_is_asked_once_for_each_sample(px4_types: Any) -> None:
    parent = px4_types.SensorCombined

    class Child(parent):  # type: ignore[misc, valid-type]
        @classmethod
        def decode(cls, data: Any, allow_surplus: Any = False) -> Any:  # noqa: FBT002 - same signature as the parent
            message = parent.decode.__func__(cls, data, allow_surplus)
            message.timestamp += 1
            return message

    sample = parent(timestamp=7).encode()
    swapped = b"\0\0" + sample[2:4] + sample[11:3:-1] + sample[12:]
    assert [Child.decode(data).timestamp for data in (sample, sample + b"1", swapped)] == [8, 8, 8]


def test_a_subclass_keeps_its_own_lazy(px4_types: Any) -> None:
    parent = px4_types.SensorCombined
    sample = parent(timestamp=7).encode()
    before: Any = type("Before", (parent,), {})
    parent.lazy(sample)
    own: Any = type("Own", (parent,), {"lazy": classmethod(lambda cls, data: (cls, data))})
    heir: Any = type("Heir", (own,), {})
    after: Any = type("After", (before,), {})
    before.lazy(sample)
    assert (own.lazy(1), heir.lazy(2)) == ((own, 1), (heir, 2))
    assert [type(cls.lazy(sample)).__mro__[1] for cls in (parent, before, after)] == [parent, before, after]


def test_lazy_itself_can_be_sent_to_other_processes(px4_types: Any) -> None:
    sample = px4_types.SensorCombined(timestamp=7).encode()
    for _ in range(2):  # the first call replaces the function
        assert pickle.loads(pickle.dumps(px4_types.SensorCombined.lazy))(sample).timestamp == 7  # noqa: S301
    assert "view of the sample" in px4_types.SensorCombined.lazy.__doc__


def test_errors_of_subclasses_name_the_message(px4_types: Any) -> None:
    child: Any = type("Child", (px4_types.SensorCombined,), {})
    for call in (child.decode, child.lazy, lambda data: child.decode_batch([data])):
        with pytest.raises(px4_types.DecodeError) as caught:
            call(b"\0\1\0\0")
        assert re.search("SensorCombined.timestamp: expected 48 bytes after the header, got 0", str(caught.value))
