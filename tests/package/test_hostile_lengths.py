"""Tests of hostile samples: truncated anywhere, with any four bytes replaced by a large number, or with changed bytes.

Each sample raises DecodeError if reference.py finds it malformed, and otherwise gives the message that reference.py
reads. Decoding needs no more memory than the size of the sample justifies.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest

from msggen.definitions.model import Catalog, Message
from support.catalogs import catalog_of
from support.examples import by_day, examples, some
from support.other_codecs import Generated, everything, generated
from support.random_definitions import TOLERATED, random_catalog, values_of
from support.reference import HEADERS, MalformedError, deserialize, serialize

INNER = "uint8 a\nfloat64[] b\nstring c\n"
EVERYTHING = {
    "msg/Nothing.msg": "",
    "msg/Static.msg": "uint8 a\nuint64 b\nuint8[3] c\n",
    "msg/Inner.msg": INNER,
    "msg/Everything.msg": "bool a\nstring b\nstring<=5 c\nwstring d\nwstring<=3[] e\nstring[2] f\nstring[] g\n"
    "bool[] h\nuint8[] i\nint16[<=3] j\nfloat64[] k\nint32[17] l\nNothing[] m\nStatic n\nStatic[2] o\nStatic[] p\n"
    "Inner[<=2] q\nInner[1] r\nNothing s\nuint64 t\nbyte[<=4] u\n",
}
INSIDE = {"a": 1, "b": [1.5], "c": "c"}
STATIC = {"a": 1, "b": 2, "c": [3, 4, 5]}
VALUES = {"a": True, "b": "text", "c": "é", "d": "a😀", "e": ["", "b"], "f": ["a", "bcd"], "g": ["a"], "i": [1, 2, 3]}
VALUES |= {"h": [True, False], "j": [-1], "k": [0.5, 1.5], "l": [7] * 17, "m": [{}, {}], "n": STATIC, "o": [STATIC] * 2}
VALUES |= {"p": [STATIC], "q": [INSIDE], "r": [INSIDE], "s": {}, "t": 2**64 - 1, "u": [255]}
"""One sample with every type that has a length, and with other fields around them."""

LARGE = (0, 1, 5, 2**16, 2**31 - 1, 2**31, 2**32 - 4, 2**32 - 1)

FACTOR, OVERHEAD = 100, 100_000
"""Bytes of memory per byte of a sample, plus a constant, since even a message of one byte becomes an object."""


PARAMS = [
    pytest.param(each, marks=[pytest.mark.night] * (place in (0, 3))) for place, each in enumerate(sorted(HEADERS))
]
"""Each byte order and each version by day, and all pairs of them at night."""


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Generated]:
    folder = tmp_path_factory.mktemp("everything")
    with generated(catalog_of(folder, EVERYTHING, TOLERATED), folder) as made:
        yield made


@pytest.fixture(params=PARAMS, ids=lambda encoding: f"XCDR{encoding[1]}-{encoding[0]}")
def encoding(request: pytest.FixtureRequest) -> Any:
    return request.param


def sample_of(catalog: Catalog, encoding: tuple[str, int]) -> tuple[Message, bytes]:
    message = catalog.messages["px4_msgs/Everything"]
    return message, serialize(catalog, message, VALUES, *encoding)


def outcome(ours: Generated, message: Message, sample: bytes) -> str:
    """Return the values in `sample` as text, or "malformed"."""
    try:
        return repr(ours.decode(message, sample))
    except ours.errors.DecodeError:
        return "malformed"


def expected_outcome(catalog: Catalog, message: Message, sample: bytes) -> str:
    try:
        return repr(deserialize(catalog, message, sample))
    except MalformedError:
        return "malformed"


def with_large_numbers(sample: bytes, order: Any) -> Iterator[bytes]:
    """Yield `sample` with every four bytes replaced by a hostile number, or changed by one.

    By day these are every other four, and so all lengths, which are at multiples of four.
    """
    for position in some(range(4, len(sample) - 3), 2):
        given = int.from_bytes(sample[position : position + 4], order)
        for number in {*LARGE, (given + 1) % 2**32, (given - 1) % 2**32} - {given}:
            yield sample[:position] + number.to_bytes(4, order) + sample[position + 4 :]


def with_flipped_bits(sample: bytes, chance: Random, count: int) -> Iterator[bytes]:
    """Yield `sample` with up to four bits changed, in the header too."""
    for _ in range(count):
        changed = bytearray(sample)
        for _ in range(chance.randint(1, 4)):
            changed[chance.randrange(len(sample))] ^= 1 << chance.randrange(8)
        yield bytes(changed)


def test_a_sample_cut_off_anywhere_is_an_error(ours: Generated, encoding: tuple[str, int]) -> None:
    message, sample = sample_of(ours.catalog, encoding)
    assert ours.decode(message, sample) == VALUES
    for length in range(len(sample)):
        with pytest.raises(ours.errors.DecodeError, match=r"^(Everything|Static|Inner)\b"):
            ours.cls(message).decode(sample[:length])


@pytest.mark.slow
def test_hostile_numbers_give_an_error_or_what_the_reference_reads(ours: Generated, encoding: tuple[str, int]) -> None:
    message, sample = sample_of(ours.catalog, encoding)
    outcomes = set()
    for hostile in with_large_numbers(sample, encoding[0]):
        found = outcome(ours, message, hostile)
        assert found == expected_outcome(ours.catalog, message, hostile), hostile.hex(" ")
        outcomes.add(found == "malformed")
    assert outcomes == {True, False}


@pytest.mark.slow
def test_hostile_numbers_take_no_more_memory_than_the_sample_accounts_for(
    ours: Generated, encoding: tuple[str, int]
) -> None:
    message, sample = sample_of(ours.catalog, encoding)
    decode = ours.cls(message).decode
    hostile_samples = [*with_large_numbers(sample, encoding[0])]
    assert peak_of(decode, hostile_samples, ours.errors.DecodeError) < FACTOR * len(sample) + OVERHEAD


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Nothing", "Static", "Inner"])
def test_many_small_elements_take_memory_in_proportion(name: str, tmp_path: Path) -> None:
    """Decode large messages from few bytes: as many elements as there can be, and counts greater than that."""
    files = {f"msg/{inner}.msg": text for inner, text in (("Static", "uint8 a\n"), ("Nothing", ""), ("Inner", INNER))}
    catalog = catalog_of(tmp_path, {**files, "msg/Many.msg": f"{name}[] many\n"}, TOLERATED)
    with generated(catalog, tmp_path) as ours:
        body = bytes(100_000)
        for count in (len(body), len(body) + 1, 2**32 - 1):
            sample = b"\0\1\0\0" + count.to_bytes(4, "little") + body
            decode = ours.types.Many.decode
            assert peak_of(decode, [sample], ours.errors.DecodeError) < FACTOR * len(sample) + OVERHEAD


def peak_of(decode: Any, samples: list[bytes], failure: type[Exception]) -> int:
    """Return the peak memory of decoding any of `samples`, the second time: the first one may import modules."""

    def decode_all() -> None:
        for sample in samples:
            with suppress(failure):
                decode(sample)

    decode_all()
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        decode_all()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


ELEMENTS = {"bool": True, "uint8": 1, "int16": 1, "float64": 0.5, "string": "a", "wstring": "a", "Inner": INSIDE}
BOUNDED: dict[str, Any] = {f"{name}[<=3]": [value] * 4 for name, value in ELEMENTS.items()}
BOUNDED |= {"string<=3": "éééé", "wstring<=3": "éééé", "string<=3[]": ["a", "éééé"], "wstring<=3[2]": ["éééé", ""]}
"""Types with a bound, and values that exceed it by one."""


@pytest.mark.parametrize("type_", BOUNDED)
def test_what_is_beyond_a_bound_is_neither_read_nor_written(type_: str, tmp_path: Path) -> None:
    bound = type_.replace("3", "4", 1)
    files = {"msg/Inner.msg": INNER, "msg/Tight.msg": f"{type_} a\n", "msg/Loose.msg": f"{bound} a\n"}
    catalog = catalog_of(tmp_path, files, TOLERATED)
    tight, loose = catalog.messages["px4_msgs/Tight"], catalog.messages["px4_msgs/Loose"]
    values = {"a": BOUNDED[type_]}
    with generated(catalog, tmp_path) as ours:
        for encoding in HEADERS:
            sample = ours.encode(loose, values, *encoding)
            assert ours.decode(loose, sample) == values
            assert outcome(ours, tight, sample) == expected_outcome(catalog, tight, sample) == "malformed"
            with pytest.raises(ours.errors.EncodeError):
                ours.encode(tight, values, *encoding)


@pytest.mark.slow
@by_day("seed", range(2), 2)
def test_random_messages_changed_by_chance_give_an_error_or_what_the_reference_reads(seed: int, tmp_path: Path) -> None:
    chance = Random(seed)  # noqa: S311 - not used for security
    catalog = random_catalog(tmp_path, chance, examples(60), examples(5))
    with generated(catalog, tmp_path) as ours:
        for message in everything(catalog):
            for encoding in HEADERS:
                sample = serialize(catalog, message, values_of(catalog, message, chance), *encoding)
                cut = sample[: chance.randrange(len(sample))]
                assert outcome(ours, message, cut) == "malformed", message
                if len(sample) < 1000:
                    for changed in with_flipped_bits(sample, chance, 20):
                        expected = expected_outcome(catalog, message, changed)
                        assert outcome(ours, message, changed) == expected, (message, changed.hex(" "))
