"""Tests against samples written by the firmware's serializer: the embedded set, and other releases from `../shared`."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import pytest

from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package
from support.examples import by_day
from support.reference import deserialize, serialize, to_object, to_values
from support.repository import VECTORS, shared
from support.samples import USUAL, plain, samples_of_vectors

HEADER = b"\0\1\0\0"


@pytest.mark.slow
def test_the_embedded_set_reads_and_writes_the_bytes_of_the_firmware(embedded: Catalog, px4_types: Any) -> None:
    assert check(embedded, px4_types, VECTORS / "cdr.json") == 5 * 259


@pytest.mark.slow
@by_day("release", ["v1.14", "v1.16", "v1.17", "v1.18"], 4)
def test_a_release_reads_and_writes_the_bytes_of_its_firmware(release: str, tmp_path: Path) -> None:
    vectors = shared(f"oracles/cdr-{release}.json")
    catalog = read_catalog(find_sources(str(shared(f"firmware/{release}"))))
    package = import_package(catalog, tmp_path)
    assert check(catalog, package, vectors) == 5 * len(catalog.messages)
    for name, samples in samples_of_vectors(catalog, vectors).items():
        cls = getattr(package, name)
        messages = [cls.decode(sample) for sample in samples[USUAL]]
        array = cls.decode_batch(samples[USUAL])
        assert plain(array) == plain(messages) == plain([cls.lazy(sample) for sample in samples[USUAL]]), name
        assert cls.encode_batch(array) == [message.encode() for message in messages], name


def check(catalog: Catalog, package: Any, path: Path) -> int:
    """Compare both codecs with every vector; return the number of vectors."""
    vectors = json.loads(path.read_text())
    for vector in vectors:
        message = catalog.messages[f"px4_msgs/{vector['type']}"]
        stale = bytes.fromhex(vector["hex"])
        clean = bytes(0 if index in vector["padding"] else byte for index, byte in enumerate(stale))
        decoded = getattr(package, message.name).decode(HEADER + stale)
        label = f"{message.name}, variant {vector['variant']}"
        assert decoded.encode() == HEADER + clean, label
        assert same(to_values(catalog, message, decoded), vector["values"]), label
        assert same(deserialize(catalog, message, HEADER + stale), vector["values"]), label
        assert to_object(package, catalog, message, vector["values"]).encode() == HEADER + clean, label
        assert serialize(catalog, message, vector["values"], "little", 1) == HEADER + clean, label
    return len(vectors)


def same(found: Any, expected: Any) -> bool:
    """Compare values: numbers as the float32 or float64 that both represent, NaN as equal to NaN."""
    if isinstance(expected, dict):
        return found.keys() == expected.keys() and all(same(found[name], expected[name]) for name in expected)
    if isinstance(expected, list):
        return len(found) == len(expected) and all(map(same, found, expected))
    if isinstance(found, float):
        return found == expected or _float32(expected) == found or (math.isnan(found) and math.isnan(expected))
    return type(found) is type(expected) and bool(found == expected)


def _float32(value: float) -> float:
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.inf
