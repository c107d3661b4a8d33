"""Tests of the generated codec against reference.py: random definitions, random values, every encoding."""

from __future__ import annotations

import json
import struct
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from msggen.definitions.model import ArrayKind, Catalog, Message
from msggen.definitions.primitives import PRIMITIVES
from support.catalogs import catalog_of, import_package
from support.examples import by_day, examples, some
from support.reference import HEADERS, serialize, to_object, to_values
from support.repository import VECTORS
from support.strategies import definitions, values_of

ENCODINGS = sorted(HEADERS)


def bits(value: Any) -> Any:
    """Make values comparable: floats as their bits, so that NaN equals NaN and -0.0 differs from 0.0."""
    if isinstance(value, dict):
        return {name: bits(item) for name, item in value.items()}
    if isinstance(value, list):
        return [bits(item) for item in value]
    return struct.pack("<d", value) if isinstance(value, float) else value


@pytest.mark.slow
@settings(max_examples=examples(150, by_day=8), suppress_health_check=list(HealthCheck))
@given(definitions(), st.data())
def test_random_messages_equal_the_reference_in_every_encoding(files: dict[str, str], data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        catalog = catalog_of(Path(folder), files)
        package = import_package(catalog, Path(folder))
        for message in catalog.messages.values():
            values = data.draw(values_of(catalog, message))
            sample = to_object(package, catalog, message, values)
            assert sample.encode() == serialize(catalog, message, values, "little", 1)
            for order, version in ENCODINGS:
                wire = serialize(catalog, message, values, order, version)
                decoded = type(sample).decode(wire)
                assert bits(to_values(catalog, message, decoded)) == bits(values), (order, version)
                assert decoded == sample


@pytest.mark.slow
@pytest.mark.parametrize(("order", "version"), ENCODINGS)
def test_every_embedded_message_decodes_from_every_encoding(
    order: str, version: int, embedded: Catalog, px4_types: Any
) -> None:
    for vector in some(json.loads((VECTORS / "cdr.json").read_text()), 3):  # of the five of each message
        message = embedded.messages[f"px4_msgs/{vector['type']}"]
        wire = serialize(embedded, message, vector["values"], order, version)
        decoded = getattr(px4_types, message.name).decode(wire)
        assert decoded.encode() == serialize(embedded, message, vector["values"], "little", 1)


@pytest.mark.slow
@by_day(("surplus", "order", "version"), [(surplus, *each) for surplus in range(4) for each in ENCODINGS], 3)
def test_padding_is_ignored_whatever_stands_in_it(
    order: str, version: int, surplus: int, embedded: Catalog, px4_types: Any
) -> None:
    """The firmware leaves stale memory in padding, and the length of samples is rounded up."""
    message = embedded.messages["px4_msgs/EscStatus"]
    values = to_values(embedded, message, px4_types.EscStatus())
    clean = serialize(embedded, message, values, order, version)
    values["esc"][7]["timestamp"] = values["timestamp"] = 2**64 - 1
    expected = to_object(px4_types, embedded, message, values)
    wire = serialize(embedded, message, values, order, version)
    padding = [index for index in range(4, len(clean)) if index in _padding(embedded, message, order, version)]
    assert padding
    stale = bytes(0xA5 if index in padding else byte for index, byte in enumerate(wire)) + b"\xa5" * surplus
    assert px4_types.EscStatus.decode(stale) == expected


def _padding(catalog: Catalog, message: Message, order: str, version: int) -> set[int]:
    """Return the positions of zero bytes in a sample in which no value contains a zero byte."""

    def full(outer: Message) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for field in outer.fields:
            inner = None if field.type.is_primitive else catalog.nested(outer, field.type)
            one = _without_zero_byte(field.type.name) if inner is None else full(inner)
            values[field.name] = one if field.type.array is ArrayKind.SCALAR else [one] * field.type.length
        return values

    wire = serialize(catalog, message, full(message), order, version)
    headers = {20, 21, 22, 23} if version == 2 else set()
    return {index for index in range(4, len(wire)) if wire[index] == 0} - headers


def _without_zero_byte(name: str) -> Any:
    if name == "bool":
        return True
    if name in ("float32", "float64"):
        code, size = {"float32": ("<f", 4), "float64": ("<d", 8)}[name]
        return struct.unpack(code, b"\x41" * size)[0]
    low, high = PRIMITIVES[name].integer_range
    return -1 if low < 0 else high
