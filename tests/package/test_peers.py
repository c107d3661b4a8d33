"""Tests of the generated codec against other codecs, for everything that ROS 2's types can express.

For thousands of random definitions with random values, the generated package, reference.py, rosbags and pycdr2 agree on
every byte and every value, in every encoding that each of them supports. Types that none of the others supports are
tested with samples of rclpy.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from msggen.definitions.model import Catalog, Message
from msggen.definitions.primitives import STRINGS
from support.catalogs import catalog_of
from support.examples import examples
from support.other_codecs import CANNOT, Codec, Pycdr2, Rosbags, everything, generated
from support.random_definitions import TOLERATED, random_catalog, values_of
from support.reference import HEADERS, Values, padding, serialize
from support.repository import VECTORS

MESSAGES, SERVICES = examples(80), examples(10)
"""Per batch. Counting both halves of a service, these are 100 definitions, and a third of them by day."""

ALL_CAN = [name for name in STRINGS if ("rosbags", name) not in CANNOT and ("pycdr2", name) not in CANNOT]


class Sample(NamedTuple):
    """Values of a message, and the bytes that reference.py encodes them to, by encoding."""

    message: Message
    values: Values
    encoded: dict[tuple[str, int], bytes]


class Batch(NamedTuple):
    """Definitions, and samples of all of them."""

    catalog: Catalog
    samples: list[Sample]


def random_batch(folder: Path, seed: int, strings: Sequence[str] = STRINGS) -> Batch:
    """Write random definitions into `folder`; return them with two random samples of each."""
    chance = Random(seed)  # noqa: S311 - not used for security
    catalog = random_catalog(folder, chance, MESSAGES, SERVICES, strings)
    samples = []
    for message in [*everything(catalog)] * 2:
        values = values_of(catalog, message, chance)
        encoded = {encoding: serialize(catalog, message, values, *encoding) for encoding in HEADERS}
        samples.append(Sample(message, values, encoded))
    return Batch(catalog, samples)


def story(message: Message, encoding: tuple[str, int]) -> str:
    """Return a description of the message for a failed assertion."""
    fields = ", ".join(f"{field.type} {field.name}" for field in message.fields)
    return f"{message.key} ({fields}) in {encoding}"


def check(codec: Codec, batch: Batch) -> None:
    """Check that all values encode to the bytes of reference.py and decode to the same values."""
    for message, values, encoded in batch.samples:
        expected = repr(values)
        for encoding in codec.encodings:
            assert codec.encode(message, values, *encoding) == encoded[encoding], story(message, encoding)
            assert repr(codec.decode(message, encoded[encoding])) == expected, story(message, encoding)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.night) for seed in range(1, 20))])
def test_all_codecs_agree_on_random_messages(seed: int, tmp_path: Path) -> None:
    batch = random_batch(tmp_path, seed, ALL_CAN)
    check(Rosbags(batch.catalog), batch)
    check(Pycdr2(batch.catalog), batch)
    with generated(batch.catalog, tmp_path) as ours:
        check(ours, batch)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.night) for seed in range(1, 5))])
def test_random_messages_that_no_peer_can_do_equal_the_reference(seed: int, tmp_path: Path) -> None:
    batch = random_batch(tmp_path, seed)
    with generated(batch.catalog, tmp_path) as ours:
        check(ours, batch)


@pytest.mark.slow
def test_padding_is_ignored_whatever_stands_in_it(tmp_path: Path) -> None:
    """rclpy leaves stale memory in padding, and up to 3 bytes after the last value."""
    batch = random_batch(tmp_path, 100)
    with generated(batch.catalog, tmp_path) as ours:
        for message, values, encoded in batch.samples:
            for encoding in HEADERS:
                sample = bytearray(encoded[encoding])
                for position in padding(batch.catalog, message, values, *encoding):
                    sample[position] = 0xA5
                for surplus in (b"", b"\xa5", b"\xa5\xa5\xa5"):
                    assert repr(ours.decode(message, bytes(sample) + surplus)) == repr(values), story(message, encoding)


RCLPY = json.loads((VECTORS / "rclpy.json").read_text(encoding="utf-8"))


def test_samples_of_rclpy_are_read_and_written_alike(tmp_path: Path) -> None:
    """The recorded samples have zeros where rclpy had left stale memory: in padding, and after the last value."""
    catalog = catalog_of(tmp_path, RCLPY["definitions"], TOLERATED)
    with generated(catalog, tmp_path) as ours:
        for vector in RCLPY["samples"]:
            message, sample = catalog.messages[f"px4_msgs/{vector['type']}"], bytes.fromhex(vector["hex"])
            assert repr(ours.decode(message, sample)) == repr(vector["values"]), message.name
            encoded = ours.encode(message, vector["values"], "little", 1)
            assert encoded == sample[: len(encoded)] == serialize(catalog, message, vector["values"], "little", 1)
            assert not any(sample[len(encoded) :])
