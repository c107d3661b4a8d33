"""Whatever ROS 2's types can say, the generated codec writes and reads as others do.

Thousands of random definitions with random values: the generated package, reference.py, rosbags and pycdr2 agree on
every byte and every value, in every encoding that each of them has.
"""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest
from conftest import catalog_of
from other_codecs import CANNOT, Codec, Pycdr2, Rosbags, everything, generated
from random_definitions import TOLERATED, definitions, values_of
from reference import HEADERS, Values, padding, serialize

from msggen.model import STRINGS, Catalog, Message

MESSAGES, SERVICES = 80, 10
"""Of one batch: 100 definitions."""

ALL_CAN = [name for name in STRINGS if ("rosbags", name) not in CANNOT and ("pycdr2", name) not in CANNOT]


class Batch(NamedTuple):
    """Definitions, and values for all of them."""

    catalog: Catalog
    values: list[tuple[Message, Values]]


def random_batch(folder: Path, seed: int, strings: tuple[str, ...] | list[str] = STRINGS) -> Batch:
    """Return random definitions, written into `folder`, and two random values for each."""
    chance = Random(seed)  # noqa: S311 - no secret
    catalog = catalog_of(folder, definitions(chance, MESSAGES, SERVICES, strings), TOLERATED)
    drawn = [(message, values_of(catalog, message, chance)) for message in everything(catalog) for _ in range(2)]
    return Batch(catalog, drawn)


def story(message: Message, encoding: tuple[str, int]) -> str:
    """Return what a failure is about."""
    fields = ", ".join(f"{field.type} {field.name}" for field in message.fields)
    return f"{message.name} ({fields}) in {encoding}"


def check(codec: Codec, batch: Batch) -> None:
    """All values become the bytes that reference.py makes of them, and come back."""
    for message, values in batch.values:
        for encoding in codec.encodings:
            expected = serialize(batch.catalog, message, values, *encoding)
            assert codec.encode(message, values, *encoding) == expected, story(message, encoding)
            assert repr(codec.decode(message, expected)) == repr(values), story(message, encoding)


@pytest.mark.parametrize("seed", range(20))
def test_all_codecs_agree_on_random_messages(seed: int, tmp_path: Path) -> None:
    batch = random_batch(tmp_path, seed, ALL_CAN)
    check(Rosbags(batch.catalog), batch)
    check(Pycdr2(batch.catalog), batch)
    with generated(batch.catalog, tmp_path) as ours:
        check(ours, batch)


@pytest.mark.parametrize("seed", range(5))
def test_random_messages_that_no_peer_can_do_equal_the_reference(seed: int, tmp_path: Path) -> None:
    batch = random_batch(tmp_path, seed)
    with generated(batch.catalog, tmp_path) as ours:
        check(ours, batch)


def test_padding_is_ignored_whatever_stands_in_it(tmp_path: Path) -> None:
    """rclpy leaves stale memory in it, and up to 3 bytes behind the last value."""
    batch = random_batch(tmp_path, 100)
    with generated(batch.catalog, tmp_path) as ours:
        for message, values in batch.values:
            for encoding in HEADERS:
                sample = bytearray(serialize(batch.catalog, message, values, *encoding))
                for position in padding(batch.catalog, message, values, *encoding):
                    sample[position] = 0xA5
                for surplus in (b"", b"\xa5", b"\xa5\xa5\xa5"):
                    assert repr(ours.decode(message, bytes(sample) + surplus)) == repr(values), story(message, encoding)
