"""Tests of structured arrays of samples, which compare a batch with `decode` and `encode`, one value at a time.

Each element of an array equals the result of `decode` for its sample, in whatever form the samples are given, and
`encode_batch` gives the same bytes as `encode`.
"""

from __future__ import annotations

import contextlib
import copy
import importlib
import io
import itertools
import mmap
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.lib import recfunctions

from msggen.definitions.model import Catalog
from support.catalogs import catalog_of, import_package
from support.examples import examples, some
from support.reference import HEADERS
from support.repository import ROOT, SOME, every_message
from support.samples import (
    ENCODINGS,
    HEADER,
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

STALE = b"\xa5"


@pytest.fixture(scope="module")
def vectors(embedded: Catalog) -> dict[str, Samples]:
    return samples_of_vectors(embedded)


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> MadeUp:
    return MadeUp(tmp_path_factory.mktemp("made_up"))


def batch_of(cls: Any) -> Any:
    """Return the module `batch` of the package that a class is in."""
    return importlib.import_module(cls.__module__.split(".")[0] + ".batch")


def rounded_up(sample: bytes) -> bytes:
    return sample + STALE * (-len(sample) % 4)


# The two checks that most tests use


def ways_to_give(samples: list[bytes]) -> Iterator[tuple[str, Any]]:
    yield "a list", samples
    yield "a generator", (sample for sample in samples)
    kinds: list[Callable[[bytes], Any]] = [bytearray, memoryview, bytes, lambda sample: np.frombuffer(sample, np.uint8)]
    yield "a tuple of several kinds", tuple(kinds[index % 4](sample) for index, sample in enumerate(samples))
    yield "memoryviews with gaps", [memoryview(bytes(itertools.chain(*zip(s, s, strict=True))))[::2] for s in samples]
    yield "mixed surplus", [sample + STALE * ((index + 1) % 4) for index, sample in enumerate(samples)]
    for surplus in (1, 2, 3):
        yield f"surplus {surplus}", [sample + STALE * surplus for sample in samples]
    yield "options", [sample[:2] + STALE * 2 + sample[4:] for sample in samples]
    yield "a buffer", b"".join(samples)
    yield "a buffer, rounded up", b"".join(map(rounded_up, samples))
    yield "a numpy array", np.frombuffer(b"".join(samples), np.uint8).reshape(len(samples), -1)


def check_decoding(cls: Any, samples: list[bytes]) -> None:
    """Check that every way to pass samples gives an array whose elements equal the results of `decode`."""
    expected = [plain(cls.decode(sample)) for sample in samples]
    for way, given_ in ways_to_give(samples):
        array = cls.decode_batch(given_)
        assert array.dtype == cls.dtype(), way
        assert plain(array) == expected, way
        assert all_bools_are_usual(array), way


def all_bools_are_usual(array: Any) -> bool:
    """Whether every bool is 0 or 1 in memory, as numpy assumes."""
    if array.dtype.names:
        return all(all_bools_are_usual(array[name]) for name in array.dtype.names)
    return array.dtype != bool or bool((array.view(np.uint8) <= 1).all())


def layouts(array: Any) -> Iterator[tuple[str, Any]]:
    """Yield arrays of the same elements with other memory layouts."""
    yield "itself", array
    yield "a view with steps", np.repeat(array, 2)[::2]
    yield "reversed twice", array[::-1].copy()[::-1]
    yield "picked", array[list(range(len(array)))]
    yield "chosen by a mask", array[np.ones(len(array), bool)]
    yield "concatenated", np.concatenate([array[:1], array[1:]])
    yield "packed outside", recfunctions.repack_fields(array)
    yield "packed throughout", recfunctions.repack_fields(array, recurse=True)
    yield "aligned", recfunctions.repack_fields(array, align=True, recurse=True)
    yield "big-endian", array.astype(array.dtype.newbyteorder(">"))
    yield "a recarray", array.view(np.recarray)
    yield "fields in another order", array[list(reversed(array.dtype.names))]
    turned = np.zeros(len(array), reversed_type(array.dtype))
    copy_by_name(turned, array)
    yield "fields in another order throughout", turned
    written = np.zeros(len(array), array.dtype)
    written.view(np.uint8)[:] = 0xA5
    for name in array.dtype.names:
        written[name] = array[name]
    yield "written by field over garbage", written


def reversed_type(dtype: Any) -> Any:
    """Return the type with its fields in reverse order, those of nested messages too."""
    if dtype.names is None:
        return dtype
    return np.dtype([(name, reversed_type(dtype[name].base), dtype[name].shape) for name in reversed(dtype.names)])


def copy_by_name(target: Any, source: Any) -> None:
    for name in target.dtype.names:
        if target[name].dtype.names:
            copy_by_name(target[name], source[name])
        else:
            target[name] = source[name]


def check_encoding(cls: Any, samples: list[bytes]) -> None:
    """Check that every layout of an array gives the bytes of `encode`, and the same objects and columns."""
    messages = [cls.decode(sample) for sample in samples]
    expected, values, columns = [message.encode() for message in messages], plain(messages), in_columns(messages)
    for layout, array in layouts(cls.decode_batch(samples)):
        assert cls.encode_batch(array) == expected, layout
        assert [plain(cls.from_row(row)) for row in array] == values, layout
        check_columns(cls, array, columns)


def check_columns(cls: Any, array: Any, values: dict[str, list[str]]) -> None:
    found = batch_of(cls).columns(array)
    assert {label: [repr(value) for value in column.tolist()] for label, column in found.items()} == values
    for column in found.values():
        assert type(column) is np.ndarray
        assert column.ndim == 1
        assert column.flags.c_contiguous
        assert column.dtype.isnative
        assert not np.shares_memory(column, array)


def named(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the numbers in a message with their names in pyulog's spelling."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from named(item, f"{path}[{index}]")
    else:
        for name, item in value.items():
            yield from named(item, f"{path}.{name}" if path else name)


def in_columns(messages: list[Any]) -> dict[str, list[str]]:
    rows = [list(named(plain(message))) for message in messages]
    labels = [label for label, _ in rows[0]]
    assert len(set(labels)) == len(labels)
    return {label: [row[index][1] for row in rows] for index, label in enumerate(labels)}


# Every message in every encoding


@pytest.mark.slow
@every_message
def test_elements_are_what_decode_gives(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    for samples in some_of(name, vectors[name]):
        check_decoding(getattr(px4_types, name), samples)


@every_message
def test_arrays_encode_as_their_messages_do(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    check_encoding(getattr(px4_types, name), vectors[name][USUAL])


@pytest.mark.slow
@settings(max_examples=examples(20, by_day=3), suppress_health_check=list(HealthCheck))
@given(definitions(), st.data())
def test_random_messages_are_what_decode_gives(files: dict[str, str], data: st.DataObject) -> None:
    for cls, samples in random_packages(data, files):
        for encoding in ENCODINGS:
            check_decoding(cls, samples[encoding])
        check_encoding(cls, samples[USUAL])


@pytest.mark.parametrize("count", [1, 2])
def test_arrays_of_arrays_of_messages_are_copied_right(count: int, tmp_path: Path) -> None:
    """The padding that the last Inner lacks has fields of Middle. numpy copies an array of such elements wrongly."""
    files = {
        "msg/Inner.msg": "uint64 timestamp\nbool flag\n",
        "msg/Middle.msg": "Inner[2] inner\nbool flag\nuint64 timestamp\n",
        "msg/Outer.msg": f"Middle[{count}] middle\nMiddle last\nfloat32 number\nuint64 timestamp\n",
    }
    package = import_package(catalog_of(tmp_path, files), tmp_path)
    numbers = iter(range(1, 1000))

    def middle() -> Any:
        inner = tuple(package.Inner(timestamp=next(numbers)) for _ in range(2))
        return package.Middle(inner=inner, timestamp=next(numbers))

    messages = [package.Outer(middle=tuple(middle() for _ in range(count)), last=middle()) for _ in range(2)]
    check_encoding(package.Outer, [message.encode() for message in messages])


@pytest.mark.slow
@pytest.mark.parametrize("name", MADE_UP_NAMES)
def test_unusual_messages_are_what_decode_gives(name: str, made_up: MadeUp) -> None:
    cls, samples = made_up.cls(name), made_up.samples(name)
    for encoding in ENCODINGS:
        check_decoding(cls, samples[encoding])
    check_encoding(cls, samples[USUAL])


def check_each_byte(cls: Any, samples: Samples) -> None:
    """Check a sample for every changed byte: the batch decodes it like `decode`, or gives its error with the index."""
    for encoding in ENCODINGS:
        zero = bytearray(samples[encoding][0])
        changed = some(each_byte_changed(bytes(zero)), 3)
        sound = [sample for sample in changed if isinstance(outcome(cls.decode, sample), dict)]
        array = cls.decode_batch(sound)
        assert plain(array) == [plain(cls.decode(sample)) for sample in sound]
        assert all_bools_are_usual(array)
        assert cls.encode_batch(array) == [cls.decode(sample).encode() for sample in sound]
        for sample in changed:
            if sample not in sound:
                assert outcome(cls.decode_batch, [zero, sample]) == numbered(outcome(cls.decode, sample), 1)


def numbered(text: str, number: int) -> str:
    """Return the error text of `decode` as a batch reports it."""
    return text.replace("DecodeError: ", f"DecodeError: sample {number}: ")


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_each_byte_counts_where_decode_counts_it(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    check_each_byte(getattr(px4_types, name), vectors[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["BehindAnOctet", "EndsEarly", "ManyBools", "Octets", "Tiny_Response"])
def test_each_byte_of_an_unusual_message_counts(name: str, made_up: MadeUp) -> None:
    check_each_byte(made_up.cls(name), made_up.samples(name))


# Arrays


def test_columns_stand_in_the_order_of_the_fields(px4_types: Any) -> None:
    messages = [px4_types.EscStatus()]
    found = batch_of(px4_types.EscStatus).columns(px4_types.EscStatus.decode_batch([messages[0].encode()]))
    assert list(found) == list(in_columns(messages))
    assert list(found)[-1] == "esc[11].esc_power"


def test_nested_arrays_have_the_shape_of_their_messages(px4_types: Any) -> None:
    array = px4_types.EscStatus.decode_batch([px4_types.EscStatus().encode()] * 3)
    assert array.shape == (3,)
    assert array["esc"].shape == array["esc"]["esc_rpm"].shape == (3, 12)


def buffers(samples: list[bytes], folder: Path) -> Iterator[tuple[Any, bool]]:
    """Yield the samples in every kind of buffer, and whether the buffer is writable."""
    for data in (b"".join(samples), b"".join(map(rounded_up, samples))):
        path, changing = folder / f"{len(data)}.bin", folder / f"{len(data)}-changing.bin"
        path.write_bytes(data)
        changing.write_bytes(data)
        yield data, False
        yield bytearray(data), True
        yield memoryview(data), False
        yield memoryview(bytearray(data)), True
        yield np.frombuffer(data, np.uint8), False
        yield np.frombuffer(bytearray(data), np.uint8).reshape(len(samples), -1), True
        yield np.memmap(path, np.uint8, "r"), False
        yield np.memmap(changing, np.uint8, "c"), True
        with path.open("rb") as file:
            yield mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), False
        with changing.open("r+b") as file:
            yield mmap.mmap(file.fileno(), 0), True


@pytest.mark.parametrize("name", SOME)
def test_an_array_of_a_buffer_is_a_view_of_it(
    name: str, vectors: dict[str, Samples], px4_types: Any, tmp_path: Path
) -> None:
    cls, samples = getattr(px4_types, name), vectors[name][USUAL]
    for buffer, writable in buffers(samples, tmp_path):
        array = cls.decode_batch(buffer)
        assert plain(array) == [plain(cls.decode(sample)) for sample in samples]
        octets = np.frombuffer(buffer, np.uint8)
        assert np.shares_memory(array, octets)
        assert array.flags.writeable is writable
        if writable:
            array["timestamp"][1] = 4711
            size = len(octets) // len(samples)
            assert cls.decode(octets[size : 2 * size].tobytes()).timestamp == 4711
            assert plain(array[2]) == plain(cls.decode(samples[2]))


@pytest.mark.parametrize("name", ["DebugArray", "EscStatus"])
def test_an_array_of_a_list_is_one_copy(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, samples = getattr(px4_types, name), [bytearray(sample) for sample in vectors[name][USUAL]]
    array = cls.decode_batch(samples)
    assert array.flags.writeable
    array["timestamp"] = 4711
    assert [bytes(sample) for sample in samples] == vectors[name][USUAL]
    many = samples * 1000
    for_joining = 100 * len(many)
    assert peak_of(cls.decode_batch, many) < 1.2 * sum(map(len, many)) + for_joining


def peak_of(call: Callable[[Any], Any], argument: Any) -> int:
    """Return the peak number of bytes that a call allocates."""
    tracemalloc.start()
    try:
        with contextlib.suppress(ValueError):
            call(argument)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", SOME)
def test_memory_maps_of_the_type_encode(name: str, vectors: dict[str, Samples], px4_types: Any, tmp_path: Path) -> None:
    cls, samples = getattr(px4_types, name), vectors[name][USUAL]
    stored = np.memmap(tmp_path / "array.bin", cls.dtype(), "w+", shape=len(samples))
    for index, sample in enumerate(samples):
        stored[index] = cls.decode_batch([sample])[0]
    stored.flush()
    read = np.memmap(tmp_path / "array.bin", cls.dtype(), "r")
    assert cls.encode_batch(read) == [cls.decode(sample).encode() for sample in samples]
    assert plain(cls.decode_batch(b"".join(cls.encode_batch(read)))) == plain(read)


@every_message
def test_zeros_of_the_type_are_messages_of_zeros(name: str, px4_types: Any) -> None:
    cls = getattr(px4_types, name)
    assert cls.encode_batch(np.zeros(2, cls.dtype())) == [cls().encode()] * 2
    assert cls.dtype().itemsize == len(cls().encode())


@pytest.mark.parametrize("name", SOME)
def test_sorted_arrays_encode_in_their_order(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, samples = getattr(px4_types, name), vectors[name][USUAL][3::-1]
    messages = sorted(map(cls.decode, samples), key=lambda message: message.timestamp)
    assert len({message.timestamp for message in messages}) == 4
    found = cls.encode_batch(np.sort(cls.decode_batch(samples), order="timestamp"))
    assert found == [message.encode() for message in messages]


def test_what_nobody_gave_is_an_empty_array(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    empty: list[Any] = [[], (), iter([]), b"", bytearray(), memoryview(b""), np.zeros(0, np.uint8)]
    for nothing in empty:
        array = cls.decode_batch(nothing)
        assert (array.shape, array.dtype) == ((0,), cls.dtype())
        assert array["esc"]["esc_rpm"].shape == (0, 12)
        assert cls.encode_batch(array) == []
        assert {len(column) for column in batch_of(cls).columns(array).values()} == {0}


# Bools


@pytest.mark.parametrize("kind", [bytes, bytearray])
@pytest.mark.parametrize("octet", [2, 0x80, 0xFF])
def test_an_odd_bool_is_true_and_stays_in_its_buffer(octet: int, kind: Any, px4_types: Any) -> None:
    cls = px4_types.ActuatorArmed
    usual = cls(armed=True).encode()
    offset = next(4 + field.offset for field in cls.__msg__.fields if field.name == "armed")
    buffer = kind(usual + usual[:offset] + bytes([octet]) + usual[offset + 1 :])
    before = bytes(buffer)
    array = cls.decode_batch(buffer)
    assert array["armed"].view(np.uint8).tolist() == [1, 1]
    assert array["armed"].sum() == 2
    assert cls.encode_batch(array) == [usual] * 2
    assert buffer == before


def test_an_odd_bool_in_an_array_is_encoded_as_true(px4_types: Any) -> None:
    cls = px4_types.ActuatorArmed
    array = np.zeros(1, cls.dtype())
    array["armed"].view(np.uint8)[:] = 0x80
    for layout, given_ in layouts(array):
        assert cls.encode_batch(given_) == [cls(armed=True).encode()], layout
        assert cls.from_row(given_[0]) == cls(armed=True), layout


# numpy is optional

PROGRAM = """
import sys
sys.modules["numpy"] = None  # as if it were not installed
from px4_types import EscStatus, registry
message = EscStatus.decode(EscStatus(timestamp=7).encode())
assert message == EscStatus.lazy(message.encode()) != EscStatus()
try:
    EscStatus.decode_batch([])
except ImportError as error:
    print(error)
"""


def test_only_batches_need_numpy() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT / "generated", capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("batches need numpy: pip install numpy\n", "")


# Elements and columns


@pytest.mark.parametrize(("outer", "field"), [("EscStatus", "esc"), ("PositionSetpointTriplet", "current")])
def test_nested_elements_are_messages_too(outer: str, field: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, samples = getattr(px4_types, outer), vectors[outer][USUAL]
    for _, array in layouts(cls.decode_batch(samples)):
        for row, message in zip(array, map(cls.decode, samples), strict=True):
            value = getattr(message, field)
            several = value if isinstance(value, tuple) else (value,)
            for nested, expected in zip(np.atleast_1d(row[field]), several, strict=True):
                assert type(expected).from_row(nested) == expected
            assert type(several[0]).encode_batch(np.atleast_1d(row[field])) == [one.encode() for one in several]


@pytest.mark.slow
def test_columns_go_into_pandas(px4_types: Any) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(some_columns(px4_types))
    assert frame["esc[7].esc_rpm"].tolist() == [0, 10, 20]
    assert frame["esc[7].esc_rpm"].dtype == np.int32


@pytest.mark.parametrize(("library", "table"), [("polars", "DataFrame"), ("pyarrow", "table")])
def test_columns_go_into_tables(library: str, table: str, px4_types: Any) -> None:
    found = getattr(pytest.importorskip(library), table)(some_columns(px4_types))
    assert found["esc[7].esc_rpm"].to_numpy().tolist() == [0, 10, 20]
    assert found.shape == (3, 6 + 12 * 11)


def some_columns(px4_types: Any) -> Any:
    messages = [px4_types.EscStatus(timestamp=number) for number in range(3)]
    for message in messages:
        message.esc[7].esc_rpm = 10 * message.timestamp
    return batch_of(px4_types.EscStatus).columns(px4_types.EscStatus.decode_batch(m.encode() for m in messages))


# Invalid input

NO_SAMPLES = {
    "a number": (5, "SensorCombined: expected a buffer of samples or an iterable of them, got int"),
    "None": (None, "SensorCombined: expected a buffer of samples or an iterable of them, got NoneType"),
    "a text": ("", "SensorCombined: expected a buffer of samples or an iterable of them, got str"),
    "a file": (io.BytesIO(bytes(52)), "SensorCombined: expected a buffer .*, got BytesIO: pass a memory map of it"),
    "a list of floats": ([np.zeros(13, "f4")], "sample 0: SensorCombined: expected bytes, got an array of float32"),
    "a list of objects": ([np.zeros(2, object)], "sample 0: SensorCombined: expected bytes, got an array of object"),
    "a list of numbers": ([1], "sample 0: SensorCombined: expected bytes, got int"),
    "an empty sample": ([b""], "sample 0: SensorCombined: expected an encapsulation header of 4 bytes, got 0 in all"),
    "an unknown header": ([b"\2" * 52], "sample 0: SensorCombined: expected the encapsulation header .*, got 02 02"),
    "floats": (np.zeros(13, "f4"), "SensorCombined: expected a contiguous buffer of bytes, got an array of float32"),
    "dates": (np.zeros(13, "M8[s]"), "SensorCombined: expected a buffer of bytes, got an array of datetime64"),
    "objects": (np.array([b"x", b"y"], object), r"SensorCombined: .* got an array of object .*pass its tolist\(\)"),
    "texts of numpy": (np.array([b"xyz"]), r"SensorCombined: .*, got an array of bytes24 .*view\(numpy.uint8\)"),
    "gaps": (np.zeros((4, 52), np.uint8)[::2], "SensorCombined: expected a contiguous buffer of bytes, got an array"),
    "rows": (np.zeros(2, "u1, u4"), "SensorCombined: expected a .*buffer of bytes, got an array of rows"),
    "short of a sample": (HEADER + bytes(44), "SensorCombined: expected a multiple of 52 bytes, got 48"),
    "no multiple": (HEADER + bytes(49), "SensorCombined: expected a multiple of 52 bytes, got 53, 1 too many"),
}


@pytest.mark.parametrize(("payloads", "message"), NO_SAMPLES.values(), ids=NO_SAMPLES.keys())
def test_what_is_no_samples_is_refused(payloads: Any, message: str, px4_types: Any) -> None:
    with pytest.raises(px4_types.DecodeError, match=rf"^{message}"):
        px4_types.SensorCombined.decode_batch(payloads)


@pytest.mark.parametrize("number", [0, 1, 4])
def test_errors_name_the_index_of_the_sample(number: int, px4_types: Any) -> None:
    cls = px4_types.EscStatus
    usual = cls().encode()
    for wrong in (usual[:-1], usual[:20], usual + bytes(4), b"", b"\0\1", b"\0\5" + usual[2:], None, 5, "text", [1]):
        samples: list[Any] = [usual] * 5
        samples[number] = wrong
        with pytest.raises(px4_types.DecodeError, match=rf"^sample {number}: EscStatus"):
            cls.decode_batch(samples)
        with pytest.raises(px4_types.DecodeError, match=rf"^sample {number}: EscStatus"):
            cls.decode_batch(iter(samples))


@pytest.mark.parametrize("name", SOME)
def test_valid_samples_of_any_length_are_a_batch(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    """Samples are kept with the surplus bytes of DDS; the others are those that `decode_batch` refuses beside them."""
    cls = getattr(px4_types, name)
    samples = vectors[name]
    for encoding, other in itertools.permutations(ENCODINGS, 2):
        usual = samples[encoding][0]
        payloads: list[Any] = [b"", usual[:-1], *(usual + bytes(surplus) for surplus in range(5)), None, usual]
        payloads += [b"\0\5" + usual[2:], samples[other][0], memoryview(usual)]
        found, others = valid = batch_of(cls).valid(cls, payloads)
        assert valid == ([*payloads[2:6], payloads[8], payloads[11]], [0, 1, 6, 7, 9, 10])
        assert len(cls.decode_batch(found)) == 6
        for number in others:
            with pytest.raises(px4_types.DecodeError):
                cls.decode_batch([usual, payloads[number]])
    assert batch_of(cls).valid(cls, iter([])) == ([], [])


def test_valid_takes_no_buffer(px4_types: Any) -> None:
    """The elements of a buffer are numbers, so that it would have no valid sample."""
    with pytest.raises(
        px4_types.DecodeError, match=r"^SensorCombined: expected an iterable of samples, got a buffer: "
    ):
        batch_of(px4_types.SensorCombined).valid(px4_types.SensorCombined, px4_types.SensorCombined().encode())


@pytest.mark.parametrize("padding", [0, 1])
def test_a_recording_that_stopped_early_is_cut(padding: int, px4_types: Any) -> None:
    """The error names the size of the samples, which tells whether they are rounded up."""
    cls = px4_types.EscStatus
    recording = b"".join(cls(timestamp=number).encode() + bytes(padding) for number in range(5))
    size = 495 + padding
    for rest in (1, 100, 494):
        text = f"EscStatus: expected a multiple of {size} bytes, got {4 * size + rest}, {rest} too many"
        with pytest.raises(px4_types.DecodeError, match=f"^{text}$"):
            cls.decode_batch(recording[: 4 * size + rest])
    if padding:  # cut to a multiple of the size without the padding
        with pytest.raises(
            px4_types.DecodeError, match=r"^EscStatus: expected a multiple of 496 bytes, got 1980, 492 "
        ):
            cls.decode_batch(recording[: 4 * 495])


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_buffer_with_another_encoding_in_it_is_not_cut_otherwise(count: int, px4_types: Any) -> None:
    """The samples of EscStatus have 495 bytes, so that a single one could also be one of 496 bytes."""
    usual = px4_types.EscStatus().encode()
    with pytest.raises(
        px4_types.DecodeError, match=rf"^sample {count}: EscStatus: expected the header 00 01 of sample 0"
    ):
        px4_types.EscStatus.decode_batch(usual * count + b"\0\0" + usual[2:])


@pytest.mark.parametrize("wrong", ["released", "dates"])
def test_a_sample_that_cannot_be_read_is_named(wrong: str, px4_types: Any) -> None:
    released = memoryview(b"x")
    released.release()
    given_ = released if wrong == "released" else np.zeros(52, "M8[s]")
    with pytest.raises(px4_types.DecodeError, match=r"^sample 1: SensorCombined: "):
        px4_types.SensorCombined.decode_batch([px4_types.SensorCombined().encode(), given_])


def test_errors_of_an_iterable_are_its_own(px4_types: Any) -> None:
    def broken() -> Iterator[bytes]:
        yield px4_types.SensorCombined().encode()
        raise TypeError("of somebody else")

    with pytest.raises(TypeError, match="of somebody else"):
        px4_types.SensorCombined.decode_batch(broken())


def test_lengths_that_make_up_for_each_other_are_noticed(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    usual = cls().encode()
    for shift in (1, 4, 100, len(usual)):
        with pytest.raises(px4_types.DecodeError, match=r"^sample 1: EscStatus"):
            cls.decode_batch([usual, usual[shift:], usual + bytes(shift)])
        with pytest.raises(px4_types.DecodeError, match=r"^sample 1: EscStatus"):
            cls.decode_batch([usual, usual + bytes(max(shift, 4)), usual[shift:]])
    as_many_numbers = np.frombuffer(usual + usual, np.uint16)
    assert len(as_many_numbers) == len(usual)
    with pytest.raises(px4_types.DecodeError, match=r"^sample 1: EscStatus"):
        cls.decode_batch([usual, as_many_numbers, usual])


@pytest.mark.parametrize("name", SOME)
def test_a_batch_has_one_encoding(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, samples = getattr(px4_types, name), vectors[name]
    for first, second in itertools.permutations(ENCODINGS, 2):
        for surplus in range(4):
            several = [*samples[first], samples[second][0] + bytes(surplus)]
            with pytest.raises(px4_types.DecodeError, match=rf"^sample 5: {name}"):
                cls.decode_batch(several)
        lengths = {len(samples[first][0]), len(samples[second][0])}
        if len(lengths) == 1:
            expected, given_ = HEADERS[first][:2].hex(" "), HEADERS[second][:2].hex(" ")
            text = f"^sample 5: {name}: expected the header {expected} of sample 0, got {given_}: another"
            for payloads in (several, b"".join([*samples[first], samples[second][0]])):
                with pytest.raises(px4_types.DecodeError, match=text):
                    cls.decode_batch(payloads)


def test_a_buffer_that_can_be_cut_in_two_ways_is_refused(made_up: MadeUp) -> None:
    """Eight big-endian samples of 14 bytes that contain zeros could also be seven samples of 16 bytes."""
    cls = made_up.cls("Bare_Response")
    zero = cls().encode()
    usual, swapped = b"".join([zero] * 12), b"".join([b"\0\0" + zero[2:]] * 12)
    assert len(zero) == 10
    assert len(cls.decode_batch(usual)) == 12
    with pytest.raises(ValueError, match=r"^(sample \d+: )?Bare_Response: .*10 .*12"):
        cls.decode_batch(swapped)
    assert len(cls.decode_batch([b"\0\0" + zero[2:]] * 12)) == 12


def changed_type(cls: Any, name: str, type_: Any) -> Any:
    """Return an array of zeros with the type of one field changed, or without the field if the type is None."""
    fields = [(field, cls.dtype()[field]) for field in cls.dtype().names]
    return np.zeros(
        1, [(field, type_ if field == name else own) for field, own in fields if (field, type_) != (name, None)]
    )


WRONG_TYPES: dict[str, tuple[Any, str]] = {
    "missing": (None, "EscStatus.{}: expected .*, it is missing"),
    "objects": (object, "EscStatus.{}: expected .*, got object"),
    "texts": ("S8", "EscStatus.{}: expected .*, got bytes64"),
    "dates": ("M8[us]", r"EscStatus.{}: expected .*, got datetime64\[us\]"),
    "raw": ("V8", "EscStatus.{}: expected .*, got void64"),
    "signed": ("i8", "EscStatus.{}: expected .*, got int64"),
    "narrower": ("u1", "EscStatus.{}: expected .*, got uint8"),
    "of one element": (("u8", (1,)), r"EscStatus.{}: expected .*, got uint64 of shape \(1,\)"),
    "nested": ([("x", "u8")], "EscStatus.*"),
}


@pytest.mark.parametrize("field", ["timestamp", "counter", "esc"])
@pytest.mark.parametrize(("type_", "message"), WRONG_TYPES.values(), ids=WRONG_TYPES.keys())
def test_a_wrong_type_is_refused_by_the_name_of_its_field(field: str, type_: Any, message: str, px4_types: Any) -> None:
    cls = px4_types.EscStatus
    array = changed_type(cls, field, type_)
    with pytest.raises(px4_types.EncodeError, match=message.format(field)):
        cls.encode_batch(array)
    with pytest.raises(px4_types.EncodeError, match=message.format(field)):
        cls.from_row(array[0])


def test_a_wrong_type_of_a_nested_field_is_refused_by_its_path(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    nested = np.dtype(
        [(name, "f8" if name == "esc_rpm" else cls.dtype()["esc"].base[name]) for name in cls.dtype()["esc"].base.names]
    )
    for shape in (12, 11, (12, 1), (3, 4)):
        with pytest.raises(px4_types.EncodeError, match=r"^EscStatus.esc"):
            cls.encode_batch(changed_type(cls, "esc", (nested, shape)))
    with pytest.raises(px4_types.EncodeError, match=r"^EscStatus\.esc\.esc_rpm: expected int32, got float64$"):
        cls.encode_batch(changed_type(cls, "esc", (nested, (12,))))


def test_a_field_too_many_is_refused_with_a_suggestion(px4_types: Any) -> None:
    cls = px4_types.SensorCombined
    fields = [(name, cls.dtype()[name]) for name in cls.dtype().names]
    with pytest.raises(
        px4_types.EncodeError, match="SensorCombined: expected no field 'gyro', did you mean 'gyro_rad'"
    ):
        cls.encode_batch(np.zeros(1, [*fields, ("gyro", "f4")]))


NO_ARRAYS: dict[str, Callable[[Any], Any]] = {
    "a list": lambda _: [],
    "nothing": lambda _: None,
    "bytes": lambda _: HEADER,
    "numbers": lambda _: np.zeros(3),
    "objects": lambda _: np.zeros(3, object),
    "two dimensions": lambda dtype: np.zeros((3, 2), dtype),
    "no dimension": lambda dtype: np.zeros((), dtype),
    "another message": lambda _: np.zeros(3, "u8, f4"),
}


@pytest.mark.parametrize("make", NO_ARRAYS.values(), ids=NO_ARRAYS.keys())
def test_what_is_no_array_of_the_message_is_refused(make: Callable[[Any], Any], px4_types: Any) -> None:
    cls = px4_types.SensorCombined
    array = make(cls.dtype())
    with pytest.raises(px4_types.EncodeError, match=r"^SensorCombined: expected "):
        cls.encode_batch(array)
    with pytest.raises(px4_types.EncodeError, match=r"^SensorCombined: expected "):
        cls.from_row(array)


@pytest.mark.parametrize("make", [value for key, value in NO_ARRAYS.items() if key != "another message"])
def test_columns_take_arrays_of_messages_only(make: Callable[[Any], Any], px4_types: Any) -> None:
    cls = px4_types.SensorCombined
    with pytest.raises(px4_types.cdr.CodecError, match=r"^expected a structured array of one dimension, got "):
        batch_of(cls).columns(make(cls.dtype()))


# Hostile samples


@every_message
def test_samples_of_every_length_are_read_or_refused(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls, usual = getattr(px4_types, name), vectors[name][USUAL][0]
    for sample in cut_and_lengthened(usual):
        alone = outcome(cls.decode, sample)
        expected = numbered(alone, 1) if isinstance(alone, str) else [plain(cls.decode(usual)), alone]
        assert outcome(cls.decode_batch, [usual, sample]) == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_buffers_of_every_length_are_read_or_refused(name: str, vectors: dict[str, Samples], px4_types: Any) -> None:
    cls = getattr(px4_types, name)
    for samples in vectors[name].values():
        for given_ in (samples[:3], [rounded_up(sample) for sample in samples[:3]]):
            expected, buffer = [plain(cls.decode(sample)) for sample in given_], b"".join(given_)
            sound = {number * len(given_[0]): expected[:number] for number in range(4)}
            sound |= {len(sample): expected[:1] for sample in (samples[0], rounded_up(samples[0]))}
            lengths = range(len(buffer) + 1)
            if len(rounded_up(samples[0])) - len(samples[0]) in (1, 2) and samples[0].startswith(b"\0\0"):
                lengths = range(2 * len(samples[0]))  # zero options of the second sample could be its header
            for length in lengths:
                found = outcome(cls.decode_batch, memoryview(buffer)[:length])
                assert (
                    found == sound[length]
                    if length in sound
                    else re.match(f"DecodeError: (sample [0-2]: )?{name}", found)
                )


PIECES = st.one_of(st.binary(max_size=80), st.sampled_from([*HEADERS.values()]), st.integers(0, 80).map(bytes))
GARBAGE = st.lists(PIECES, max_size=6).map(b"".join)


@pytest.mark.slow
@settings(max_examples=examples(200))
@given(st.lists(GARBAGE, min_size=1, max_size=4), st.sampled_from(["Even", "Uneven", "EndsEarly", "Bools"]))
def test_random_bytes_are_read_as_decode_does_or_refused(made_up: MadeUp, samples: list[bytes], name: str) -> None:
    cls = made_up.cls(name)
    alone = [outcome(cls.decode, sample) for sample in samples]
    headers = {sample[:2] for sample in samples}
    found = outcome(cls.decode_batch, samples)
    if any(isinstance(one, str) for one in alone) or len(headers) > 1:
        assert found.startswith("DecodeError: sample ")
    else:
        assert found == alone
    if len(samples[0]) == cls.__msg__.cdr_size + 4 and samples[0].startswith((b"\0\1", b"\0\0")):
        assert outcome(cls.decode_batch, samples[0]) == [alone[0]]


@every_message
def test_samples_of_other_messages_are_read_as_decode_does_or_refused(
    name: str, vectors: dict[str, Samples], px4_types: Any
) -> None:
    cls = getattr(px4_types, name)
    step = 1 if examples(100) == 100 else 3  # a third by day
    for samples in [*vectors.values()][crc32(name.encode()) % step :: step]:
        alone = outcome(cls.decode, samples[USUAL][1])
        expected = numbered(alone, 0) if isinstance(alone, str) else [alone] * 2
        assert outcome(cls.decode_batch, [samples[USUAL][1]] * 2) == expected


def test_hostile_input_takes_little_memory(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    usual, many = cls().encode(), 2000
    size = many * len(usual)
    cls.decode_batch([usual])
    for buffer in (HEADER + bytes(size), b"\0\7\0\0" + bytes(size), b"\xff" * size, usual * many + b"x"):
        assert peak_of(cls.decode_batch, buffer) < size / 10
    for samples in ([usual] * many + [b""], [usual] * many + [b"\0\6\0\0"], [usual] * many + [usual * 2]):
        assert peak_of(cls.decode_batch, samples) < 4 * size


def test_elements_of_a_nested_array_are_sorted_in_a_copy(px4_types: Any) -> None:
    """docs/package.md states this: the padding of EscStatus' elements overlaps the fields before them."""
    cls = px4_types.EscStatus
    message = cls(timestamp=1, counter=2, esc_count=3, esc_connectiontype=4, esc_online_flags=5, esc_armed_flags=6)
    for number, report in enumerate(message.esc):
        report.esc_rpm = -number
    array = cls.decode_batch([message.encode()])
    array["esc"] = np.sort(array["esc"], order="esc_rpm")
    assert array["esc"]["esc_rpm"].tolist() == [list(range(-11, 1))]
    expected = copy.deepcopy(message)
    expected.esc = message.esc[::-1]
    assert cls.encode_batch(array) == [expected.encode()]


def test_the_base_of_all_messages_has_no_samples(px4_types: Any) -> None:
    base = px4_types.cdr.Message
    for call in (base.dtype, lambda: base.decode_batch([]), lambda: base.lazy(b"")):
        with pytest.raises(NotImplementedError):
            call()


def test_every_column_has_a_unit(px4_types: Any) -> None:
    batch = batch_of(px4_types.EscStatus)
    for name in px4_types.msg.__all__:
        cls = getattr(px4_types, name)
        assert list(batch.units(cls)) == list(batch.columns(np.zeros(1, cls.dtype())))
    found = batch.units(px4_types.EscStatus)
    assert (found["timestamp"], found["esc[7].esc_voltage"]) == ("us", "V")
