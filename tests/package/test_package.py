"""Tests of the classes of the committed package: values, codec, errors, standard protocols, lazy imports and topics.

Sample values of every field type go through each of the 259 messages.
"""

from __future__ import annotations

import array
import ast
import copy
import dataclasses
import inspect
import itertools
import math
import mmap
import pickle
import pprint
import struct
import subprocess
import sys
import typing
from collections.abc import Callable, Hashable
from enum import IntEnum
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.definitions.model import Catalog
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES
from msggen.definitions.tags import ATTRIBUTES
from support.catalogs import catalog_of, import_package
from support.reference import HEADERS, serialize, to_values
from support.repository import NAMES, ROOT, SOME, every_message

BYTES = ("uint8", "char", "byte")


ENCODINGS = sorted(HEADERS)

FLOAT_VALUES = (0.1, -1e30, math.nan, math.inf, -math.inf, -0.0, 1e-40, 2**24 + 1)
"""Includes values that float32 rounds."""


def filled(package: Any, message_type: Any) -> Any:
    """Return a message whose values all differ: extremes, values that are rounded, and NaN."""
    numbers = itertools.count()

    def one(base: str) -> Any:
        number = next(numbers)
        if base == "bool":
            return number % 2 == 0
        if base in INTEGERS:
            low, high = PRIMITIVES[base].integer_range
            return (low, high, high - number % 100)[number % 3]
        if base in FLOATS:
            return FLOAT_VALUES[number % len(FLOAT_VALUES)]
        return message(getattr(package.msg, base))

    def message(inner: Any) -> Any:
        arguments = {}
        for field in inner.__msg__.fields:
            items = [one(field.base) for _ in range(field.length or 1)]
            several = bytes(items) if field.base in BYTES else tuple(items)
            arguments[field.name] = items[0] if field.length is None else several
        return inner(**arguments)

    return message(message_type)


def on_the_wire(package: Any, message: Any) -> dict[str, Any]:
    """Return the values as they are on the wire, floats as their bits."""

    def one(base: str, value: Any) -> Any:
        if base in FLOATS:
            return struct.pack("<f" if base == "float32" else "<d", value)
        return value if base in PRIMITIVES else on_the_wire(package, value)

    values = {}
    for field in message.__msg__.fields:
        value = getattr(message, field.name)
        several = field.length is not None
        values[field.name] = [one(field.base, item) for item in value] if several else one(field.base, value)
    return values


def sample(catalog: Catalog, message: Any, order: str, version: int) -> bytes:
    """Return `message` as a sample in any encoding, made by the codec of reference.py."""
    definition = catalog.messages[f"px4_msgs/{message.__msg__.name}"]
    return serialize(catalog, definition, to_values(catalog, definition, message), order, version)


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A package with one message that has every type, as single values and in both kinds of arrays."""
    types = ("bool", *INTEGERS, *FLOATS)
    lines = ["uint64 timestamp"]
    for type_ in types:
        lines += [f"{type_} one_{type_}", f"{type_}[3] few_{type_}", f"{type_}[20] many_{type_}"]
    folder = tmp_path_factory.mktemp("everything")
    return import_package(catalog_of(folder, {"msg/Everything.msg": "\n".join(lines)}), folder)


# Values


@every_message
def test_every_field_has_a_zero_default(name: str, px4_types: Any) -> None:
    def zero(base: str) -> Any:
        plain = {"bool": False, **dict.fromkeys(FLOATS, 0.0), **dict.fromkeys(INTEGERS, 0)}
        return plain[base] if base in plain else getattr(px4_types, base)()

    message = getattr(px4_types, name)()
    for field in message.__msg__.fields:
        value = getattr(message, field.name)
        items = [value] if field.length is None else list(value)
        assert items == [zero(field.base)] * (field.length or 1)
        assert {type(item) for item in items} == {type(zero(field.base))}
    assert message.encode() == b"\0\1\0\0" + bytes(message.__msg__.cdr_size)


@every_message
def test_what_was_encoded_decodes_to_an_equal_message(name: str, px4_types: Any) -> None:
    message_type = getattr(px4_types, name)
    message = filled(px4_types, message_type)
    decoded = message_type.decode(message.encode())
    assert type(decoded) is message_type
    assert decoded == message
    assert message == decoded
    assert on_the_wire(px4_types, decoded) == on_the_wire(px4_types, message)
    assert decoded.encode() == message.encode()


@every_message
def test_positions_and_keywords_make_the_same_message(name: str, px4_types: Any) -> None:
    message_type = getattr(px4_types, name)
    message = filled(px4_types, message_type)
    values = [getattr(message, field.name) for field in message_type.__msg__.fields]
    assert message_type(*values) == message
    assert list(inspect.signature(message_type).parameters) == [field.name for field in message_type.__msg__.fields]


@every_message
def test_the_description_is_that_of_the_definition(name: str, px4_types: Any, embedded: Catalog) -> None:
    definition, info = embedded.messages[f"px4_msgs/{name}"], getattr(px4_types, name).__msg__
    assert (info.name, info.ros_type) == (name, f"px4_msgs/msg/{name}")
    assert info.dds_type == f"px4_msgs::msg::dds_::{name}_"
    assert info.topics == definition.topic_names
    assert info.message_version == definition.message_version
    assert [(field.name, field.type) for field in info.fields] == [(f.name, str(f.type)) for f in definition.fields]
    for field, defined in zip(info.fields, definition.fields, strict=True):
        for tag in ATTRIBUTES:
            assert getattr(field, tag.name) == defined.comment.tag(tag.name)


@every_message
def test_constants_are_attributes_of_the_class(name: str, px4_types: Any, embedded: Catalog) -> None:
    message_type = getattr(px4_types, name)
    for constant in embedded.messages[f"px4_msgs/{name}"].constants:
        assert getattr(message_type, constant.name) == constant.value
        assert type(getattr(message_type, constant.name)) is type(constant.value)


def test_an_unknown_keyword_and_one_value_too_many_are_refused(px4_types: Any) -> None:
    with pytest.raises(TypeError, match="gyro_radian"):
        px4_types.SensorCombined(gyro_radian=(0.0, 0.0, 0.0))
    with pytest.raises(TypeError):
        px4_types.DebugVect(1, bytes(10), 0.0, 0.0, 0.0, 0.0)


def test_any_sequence_of_the_right_length_is_taken(px4_types: Any) -> None:
    expected = px4_types.SensorCombined(gyro_rad=(1.0, 2.0, 3.0)).encode()
    for given_ in ([1, 2, 3], array.array("d", [1, 2, 3]), (1.0, 2.0, 3.0)):
        assert px4_types.SensorCombined(gyro_rad=given_).encode() == expected
    assert px4_types.DebugKeyValue(key=bytearray(b"0123456789")).encode()[12:22] == b"0123456789"
    for several in ([1.5] * 58, (1.5,) * 58, array.array("d", [1.5] * 58), array.array("f", [1.5] * 58)):
        assert px4_types.DebugArray(data=several).encode() == px4_types.DebugArray(data=[1.5] * 58).encode()


# Equality and representation


@every_message
def test_messages_differ_when_any_value_does(name: str, px4_types: Any) -> None:
    message_type = getattr(px4_types, name)
    zero = message_type()
    for field in message_type.__msg__.fields:
        data = bytearray(zero.encode())
        data[4 + field.offset] = 1
        assert message_type.decode(data) != zero, field.name
        assert zero != message_type.decode(data), field.name


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        (0.1, struct.unpack("<f", struct.pack("<f", 0.1))[0], True),
        (math.nan, math.nan, True),
        (math.nan, -math.nan, True),
        (math.nan, 0.0, False),
        (0.0, -0.0, True),
        (1, 1.0, True),
        (1.0, 1.001, False),
        (1e39, 1e39, True),
        (1e39, 1e38, False),
        ("x", "x", True),
        ("x", 0.0, False),
    ],
)
def test_floats_are_equal_when_they_are_on_the_wire(one: Any, other: Any, equal: Any, px4_types: Any) -> None:
    """Values that cannot be encoded are compared unchanged."""
    left, right = px4_types.DebugVect(x=one), px4_types.DebugVect(x=other)
    assert (left == right) is equal
    assert (right == left) is equal
    assert (left != right) is not equal


def test_a_message_equals_none_of_another_type(px4_types: Any) -> None:
    assert px4_types.DebugValue() != px4_types.DebugVect()
    assert px4_types.DebugValue() != 0
    assert px4_types.DebugValue() is not None
    assert px4_types.DebugValue().__eq__(object()) is NotImplemented


def test_messages_are_unhashable_because_they_change(px4_types: Any) -> None:
    message = px4_types.SensorCombined()
    for each in (message, px4_types.SensorCombined.lazy(message.encode())):
        assert not isinstance(each, Hashable)
        with pytest.raises(TypeError, match="unhashable"):
            hash(each)


@every_message
def test_repr_evaluates_back(name: str, px4_types: Any) -> None:
    message = filled(px4_types, getattr(px4_types, name))
    names = {name: getattr(px4_types, name) for name in NAMES}
    names |= {"array": array.array, "nan": math.nan, "inf": math.inf}
    for shown in (message, type(message).decode(message.encode())):
        assert eval(repr(shown), names) == message  # noqa: S307 - our own text


# Python protocols


def test_match_statements_take_positions_and_keywords(px4_types: Any) -> None:
    message_type = px4_types.DebugVect
    assert message_type.__match_args__ == tuple(field.name for field in message_type.__msg__.fields)
    message = message_type(7, b"position\0\0", 1.0)
    for each in (message, message_type.lazy(message.encode())):
        match each:
            case message_type(stamp, name, x=1.0, y=y):
                assert (stamp, name, y) == (7, b"position\0\0", 0.0)
            case _:
                pytest.fail("no match")


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize("name", SOME)
def test_pickling_keeps_a_message(name: str, protocol: int, px4_types: Any) -> None:
    message = filled(px4_types, getattr(px4_types, name))
    for stored in (message, type(message).decode(message.encode())):
        loaded = pickle.loads(pickle.dumps(stored, protocol))  # noqa: S301 - our own bytes
        assert type(loaded) is type(message)
        assert on_the_wire(px4_types, loaded) == on_the_wire(px4_types, message)


def test_a_pickle_of_another_definition_is_refused(tmp_path: Path) -> None:
    old = import_package(catalog_of(tmp_path / "1", {"msg/Foo.msg": "uint64 timestamp\nuint8 a\nuint8 b"}), tmp_path)
    new = import_package(catalog_of(tmp_path / "2", {"msg/Foo.msg": "uint64 timestamp\nuint8 b\nuint8 a"}), tmp_path)
    stored = pickle.dumps(old.Foo(1, 2, 3), 0).replace(old.__name__.encode(), new.__name__.encode())
    with pytest.raises(TypeError, match="Foo: pickled from another definition"):
        pickle.loads(stored)  # noqa: S301 - our own bytes


def test_copies_are_equal_and_deep_ones_share_nothing(px4_types: Any) -> None:
    message = filled(px4_types, px4_types.EscStatus)
    shallow, deep = copy.copy(message), copy.deepcopy(message)
    assert shallow == deep == message
    assert shallow.esc[0] is message.esc[0]
    message.esc[0].esc_rpm = message.counter = 5
    assert shallow.esc[0].esc_rpm == 5
    assert deep.esc[0].esc_rpm != 5
    assert 5 not in (shallow.counter, deep.counter)


def test_a_misspelt_attribute_is_refused(px4_types: Any) -> None:
    message = px4_types.SensorCombined()
    with pytest.raises(AttributeError):
        message.gyro = (0.0, 0.0, 0.0)
    with pytest.raises(AttributeError):
        message.CLIPPING_X = 2


@every_message
def test_no_message_has_a_dictionary(name: str, px4_types: Any) -> None:
    message_type = getattr(px4_types, name)
    assert not hasattr(message_type(), "__dict__")
    assert message_type.__slots__ == tuple(field.name for field in message_type.__msg__.fields)


@pytest.mark.parametrize(
    ("name", "field"),
    [("EscStatus", "esc"), ("PositionSetpointTriplet", "current"), ("DebugArray", "data")],
)
def test_defaults_that_can_change_are_not_shared(name: str, field: str, px4_types: Any) -> None:
    one, other = (getattr(getattr(px4_types, name)(), field) for _ in range(2))
    assert one is not other
    assert name != "EscStatus" or len({id(report) for report in (*one, *other)}) == 24


# Dataclasses


@every_message
def test_the_functions_of_dataclasses_take_every_message(name: str, px4_types: Any) -> None:
    message_type = getattr(px4_types, name)
    names = [field.name for field in message_type.__msg__.fields]
    message = filled(px4_types, message_type)
    assert dataclasses.is_dataclass(message_type)
    assert [field.name for field in dataclasses.fields(message_type)] == names
    assert [field.name for field in dataclasses.fields(message)] == names
    assert list(dataclasses.asdict(message)) == names
    assert len(dataclasses.astuple(message)) == len(names)
    assert dataclasses.replace(message) == message
    assert dataclasses.replace(message, timestamp=5).timestamp == 5


def test_asdict_and_astuple_unfold_nested_messages(px4_types: Any) -> None:
    status = px4_types.EscStatus(counter=3)
    status.esc[1].esc_rpm = 9000
    assert dataclasses.asdict(status)["esc"][1]["esc_rpm"] == 9000
    assert dataclasses.astuple(status)[1] == 3
    assert dataclasses.astuple(status)[6][1][2] == 9000


def test_fields_have_the_defaults_of_the_class(px4_types: Any) -> None:
    for name in SOME:
        fields: tuple[Any, ...] = dataclasses.fields(getattr(px4_types, name))
        for field in fields:
            value = getattr(getattr(px4_types, name)(), field.name)
            if field.default is dataclasses.MISSING:
                made, again = field.default_factory(), field.default_factory()
                assert made == again == value
                assert made is not again
            else:
                assert field.default == value


def test_replace_refuses_what_is_no_field_and_leaves_the_original(px4_types: Any) -> None:
    message = px4_types.SensorCombined(timestamp=1)
    for replace in (dataclasses.replace, px4_types.SensorCombined.__replace__):
        assert replace(message, timestamp=2).timestamp == 2
        assert message.timestamp == 1
        with pytest.raises(TypeError):
            replace(message, time=2)


def test_the_base_of_all_messages_is_no_dataclass(px4_types: Any) -> None:
    assert not dataclasses.is_dataclass(px4_types.cdr.Message)


# Information in a class


def frozen_values(package: Any) -> list[Any]:
    endpoint = package.topics.ENDPOINTS[0]
    info = package.SensorCombined.__msg__
    return [info, info.fields[0], endpoint, endpoint.qos, endpoint.qos.reader, package.topics.UORB["event"]]


def test_descriptions_cannot_be_changed(px4_types: Any) -> None:
    for value in frozen_values(px4_types):
        name = type(value).__slots__[0]
        with pytest.raises(AttributeError):
            setattr(value, name, getattr(value, name))
        with pytest.raises(AttributeError):
            value.something = 1


def test_descriptions_cannot_be_deleted_from(px4_types: Any) -> None:
    for value in map(copy.copy, frozen_values(px4_types)):
        with pytest.raises(AttributeError):
            delattr(value, type(value).__slots__[0])


def test_descriptions_are_values(px4_types: Any) -> None:
    values = frozen_values(px4_types)
    assert len(set(values)) == len(values)
    for value in values:
        assert pickle.loads(pickle.dumps(value)) == copy.deepcopy(value) == value  # noqa: S301 - our own bytes
        assert hash(copy.copy(value)) == hash(value)
        assert repr(value).startswith(f"{type(value).__name__}({type(value).__slots__[0]}=")


# Imports

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
before = set(sys.modules)
{}
print(*sorted(set(sys.modules) - before))
"""


def imported_by(statement: str) -> set[str]:
    """Return the modules that `statement` imports in a new interpreter."""
    command = [sys.executable, "-I", "-S", "-c", PROGRAM.format(statement), str(ROOT / "generated")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


SHARED_MODULES = {"px4_types", "px4_types.cdr", "px4_types.msg"}


@pytest.mark.parametrize(
    ("statement", "modules"),
    [
        ("import px4_types", {"px4_types"}),
        ("from px4_types import SensorCombined", {*SHARED_MODULES, "px4_types.msg._sensor_combined"}),
        ("from px4_types.msg import SensorCombined", {*SHARED_MODULES, "px4_types.msg._sensor_combined"}),
        (
            "from px4_types import EscStatus; EscStatus.decode(EscStatus().encode())",
            {*SHARED_MODULES, "px4_types.msg._esc_status", "px4_types.msg._esc_report"},
        ),
        (
            "from px4_types import DebugArray",
            {*SHARED_MODULES, "px4_types.arrays", "px4_types.msg._debug_array"},
        ),
    ],
)
def test_one_type_imports_one_module_and_what_it_nests(statement: str, modules: set[str]) -> None:
    found = imported_by(statement)
    assert {name for name in found if name.startswith("px4_types")} == modules
    assert found.isdisjoint({"typing", "dataclasses", "enum", "re", "inspect", "numpy", "importlib"})


def test_dataclasses_are_imported_for_those_who_ask() -> None:
    asked = imported_by("from px4_types import Event; Event.__dataclass_fields__")
    assert "dataclasses" in asked


def test_no_module_imports_more_than_the_standard_library() -> None:
    everything_imported = imported_by("from px4_types import *; topics.ENDPOINTS[0].message")
    outside = {name.split(".")[0] for name in everything_imported} - set(sys.stdlib_module_names)
    assert outside == {"px4_types"}


def test_a_star_import_gives_everything(px4_types: Any) -> None:
    names: dict[str, Any] = {}
    exec("from px4_types import *", names)  # noqa: S102 - a star import is allowed only at module level
    assert {*NAMES, "topics", "msg", "srv", "cdr", "by_type", "DecodeError", "EncodeError"} == names.keys() - {
        "__builtins__"
    }
    assert all(names[name] is getattr(px4_types.msg, name) for name in NAMES)


def test_dir_lists_what_can_be_imported(px4_types: Any) -> None:
    assert set(NAMES) < set(dir(px4_types))
    assert set(dir(px4_types.msg)) == set(NAMES)
    assert all(hasattr(px4_types, name) for name in dir(px4_types))


@pytest.mark.parametrize("place", ["px4_types", "msg", "srv"])
def test_a_misspelt_name_gets_a_suggestion(place: str, px4_types: Any) -> None:
    module = px4_types if place == "px4_types" else getattr(px4_types, place)
    with pytest.raises(AttributeError, match="'VehicleComand', did you mean 'VehicleCommand'"):
        _ = module.VehicleComand
    with pytest.raises(AttributeError):
        _ = module._nothing
    assert not hasattr(module, "Zzz")


def test_importing_a_misspelt_name_is_an_import_error(px4_types: Any) -> None:
    assert px4_types
    with pytest.raises(ImportError, match="SensorCombine"):
        exec("from px4_types import SensorCombine", {})  # noqa: S102 - type checkers reject this name


def test_a_service_has_its_request_and_response(px4_types: Any) -> None:
    service = px4_types.srv.VehicleCommand
    request = service.Request(request=px4_types.VehicleCommand(command=400, param1=1.0))
    assert service.Request is px4_types.srv.VehicleCommand_Request
    assert service.Request.decode(request.encode()) == request
    assert service.Request.__msg__.ros_type == "px4_msgs/srv/VehicleCommand_Request"
    assert service.Response().reply == px4_types.VehicleCommandAck()
    assert service.Response.decode(service.Response().encode()) == service.Response()


def test_every_class_is_documented(px4_types: Any) -> None:
    for name in NAMES:
        assert len(getattr(px4_types, name).__doc__.split()) > 3, name


# Input of decode


def as_mmap(data: bytes) -> mmap.mmap:
    mapped = mmap.mmap(-1, len(data))
    mapped.write(data)
    return mapped


BYTES_LIKES: dict[str, Callable[[bytes], Any]] = {
    "bytes": bytes,
    "bytearray": bytearray,
    "memoryview": memoryview,
    "memoryview of a bytearray": lambda data: memoryview(bytearray(data)),
    "part of a memoryview": lambda data: memoryview(b"xyz" + data + b"xyz")[3:-3],
    "memoryview of 4-byte words": lambda data: memoryview(data).cast("I"),
    "memoryview of two dimensions": lambda data: memoryview(data).cast("B", (len(data) // 4, 4)),
    "array of bytes": lambda data: array.array("B", data),
    "array of signed bytes": lambda data: array.array("b", data),
    "array of 2-byte words": lambda data: array.array("H", data),
    "array of 4-byte words": lambda data: array.array("I", data),
    "mmap": as_mmap,
}


@pytest.mark.parametrize("kind", BYTES_LIKES)
@pytest.mark.parametrize(("order", "version"), ENCODINGS)
def test_decode_takes_any_bytes_like(kind: str, order: str, version: int, px4_types: Any, embedded: Catalog) -> None:
    message = filled(px4_types, px4_types.SensorCombined)
    given_ = BYTES_LIKES[kind](sample(embedded, message, order, version))
    assert px4_types.SensorCombined.decode(given_) == message


@pytest.mark.parametrize("kind", BYTES_LIKES)
def test_surplus_is_counted_in_bytes_whatever_holds_it(kind: str, px4_types: Any) -> None:
    given_ = BYTES_LIKES[kind](px4_types.SensorCombined(timestamp=1).encode() + bytes(4))
    with pytest.raises(px4_types.DecodeError, match="SensorCombined: expected 48 bytes after the header, got 52"):
        px4_types.SensorCombined.decode(given_)
    assert px4_types.SensorCombined.decode(given_, allow_surplus=True).timestamp == 1


@pytest.mark.parametrize("wrong", ["x" * 52, None, 52, list(range(52))], ids=lambda wrong: type(wrong).__name__)
def test_what_is_not_bytes_like_is_a_type_error(wrong: Any, px4_types: Any) -> None:
    for call in (px4_types.SensorCombined.decode, px4_types.SensorCombined.lazy):
        with pytest.raises(TypeError, match="bytes-like"):
            call(wrong)


@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize(("order", "version"), ENCODINGS)
def test_three_surplus_bytes_are_accepted_and_four_are_not(
    name: str, order: str, version: int, px4_types: Any, embedded: Catalog
) -> None:
    message_type = getattr(px4_types, name)
    message = filled(px4_types, message_type)
    data = sample(embedded, message, order, version)
    for surplus in range(4):
        assert message_type.decode(data + b"\xff" * surplus) == message
    for surplus in (4, 5, 1000):
        with pytest.raises(px4_types.DecodeError, match=rf"^{name}: expected .* got {len(data) - 4 + surplus}\b"):
            message_type.decode(data + bytes(surplus))
        assert message_type.decode(data + b"\xff" * surplus, allow_surplus=True) == message


@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize(("order", "version"), ENCODINGS)
def test_short_input_is_an_error_at_every_length(
    name: str, order: str, version: int, px4_types: Any, embedded: Catalog
) -> None:
    message_type = getattr(px4_types, name)
    data = sample(embedded, filled(px4_types, message_type), order, version)
    for length in range(len(data)):
        given_ = length if length < 4 else length - 4
        for allow_surplus in (False, True):
            with pytest.raises(px4_types.DecodeError, match=rf"^{name}\b.*: expected .*, got {given_}\b"):
                message_type.decode(data[:length], allow_surplus=allow_surplus)


@pytest.mark.parametrize("name", ["SensorCombined", "VehicleStatus", "BatteryStatus", "DebugArray", "VehicleCommand"])
@pytest.mark.parametrize("order", ["big", "little"])
def test_short_input_names_the_first_field_that_is_cut(
    name: str, order: str, px4_types: Any, embedded: Catalog
) -> None:
    """Padding belongs to the field after it, so the field before is complete."""
    message_type = getattr(px4_types, name)
    data = sample(embedded, message_type(), order, 1)
    wrong = {}
    for length in range(len(data) - 4):
        ends = (
            (field.offset + PRIMITIVES[field.base].size * (field.length or 1), field)
            for field in message_type.__msg__.fields
        )
        expected = next(field.name for end, field in ends if end > length)
        with pytest.raises(px4_types.DecodeError) as caught:
            message_type.decode(data[: 4 + length])
        if f"{name}.{expected}:" not in str(caught.value):
            wrong[length] = (expected, str(caught.value))
    assert wrong == {}


KNOWN_HEADERS = [header[:2] for header in HEADERS.values()]


@pytest.mark.slow
@given(header=st.binary(min_size=2, max_size=2).filter(lambda header: header not in KNOWN_HEADERS))
def test_an_unknown_header_is_an_error(header: bytes, px4_types: Any) -> None:
    """Such headers include parameter lists and delimited encodings, which no PX4 message uses."""
    with pytest.raises(px4_types.DecodeError) as caught:
        px4_types.SensorCombined.decode(header + bytes(50))
    text = str(caught.value)
    assert text.startswith("SensorCombined: expected ")
    assert text.endswith(f"got {header.hex(' ')}: no header?")


@pytest.mark.parametrize("header", KNOWN_HEADERS, ids=lambda header: header.hex())
@pytest.mark.parametrize("options", [b"\0\0", b"\0\3", b"\xff\xff"], ids=lambda options: options.hex())
def test_the_options_of_a_header_do_not_count(header: bytes, options: bytes, px4_types: Any) -> None:
    decoded = px4_types.DebugVect.decode(header + options + bytes(32))
    assert decoded == px4_types.DebugVect()


@pytest.mark.parametrize("order", ["big", "little"])
@pytest.mark.parametrize("wrong", [0, 430, 432, 2**32 - 1])
def test_a_wrong_delimiter_header_is_an_error(order: Any, wrong: int, px4_types: Any, embedded: Catalog) -> None:
    data = bytearray(sample(embedded, px4_types.EscStatus(), order, 2))
    assert int.from_bytes(data[20:24], order) == 431
    data[20:24] = wrong.to_bytes(4, order)
    with pytest.raises(px4_types.DecodeError, match=rf"EscStatus: expected .*431.* got {wrong}"):
        px4_types.EscStatus.decode(data)


# Input of encode


def encode_error(package: Any, message: Any) -> str:
    """Return the error text of encoding `message`."""
    with pytest.raises(package.EncodeError) as caught:
        message.encode()
    assert isinstance(caught.value, ValueError)
    return str(caught.value)


@pytest.mark.parametrize("type_", INTEGERS)
def test_integers_reach_from_the_lowest_to_the_highest_and_no_further(type_: str, everything: Any) -> None:
    low, high = PRIMITIVES[type_].integer_range
    for value in (low, high):
        message = everything.Everything(**{f"one_{type_}": value})
        assert getattr(everything.Everything.decode(message.encode()), f"one_{type_}") == value
    for value in (low - 1, high + 1, -(10**30), 10**30):
        text = encode_error(everything, everything.Everything(**{f"one_{type_}": value}))
        assert text == f"Everything.one_{type_}: expected {type_}, {low} to {high}, got {value}"


@pytest.mark.parametrize("type_", [type_ for type_ in INTEGERS if type_ not in BYTES])
@pytest.mark.parametrize(("kind", "length"), [("few", 3), ("many", 20)])
def test_an_integer_out_of_range_in_an_array_is_named_by_its_index(
    type_: str, kind: str, length: int, everything: Any
) -> None:
    low, high = PRIMITIVES[type_].integer_range
    for value in (low - 1, high + 1):
        values = [0] * length
        values[2] = value
        text = encode_error(everything, everything.Everything(**{f"{kind}_{type_}": values}))
        assert text == f"Everything.{kind}_{type_}[2]: expected {type_}, {low} to {high}, got {value}"


@pytest.mark.parametrize("field", ["one_uint32", "one_float64", "one_bool", "one_float32"])
def test_a_number_too_long_to_print_is_an_encode_error_too(field: str, everything: Any) -> None:
    text = encode_error(everything, everything.Everything(**{field: 10**5000}))
    assert text.startswith(f"Everything.{field}: expected")


@pytest.mark.parametrize("value", [3.5e38, -3.5e38, 1e308, pytest.param(10**400, id="10**400")])
@pytest.mark.parametrize(("kind", "length"), [("one", 1), ("few", 3), ("many", 20)])
def test_a_float32_that_overflows_is_an_error(kind: str, length: int, value: Any, everything: Any) -> None:
    given_ = value if kind == "one" else [value] * length
    text = encode_error(everything, everything.Everything(**{f"{kind}_float32": given_}))
    path = f"Everything.{kind}_float32" + ("" if kind == "one" else "[0]")
    assert text.startswith(f"{path}: expected float32")
    assert f"got {str(value)[:20]}" in text


WRONG_TYPES = [None, "1", b"1", [1], object(), 1j]


@pytest.mark.parametrize("wrong", WRONG_TYPES, ids=lambda wrong: type(wrong).__name__)
@pytest.mark.parametrize("type_", ["bool", *INTEGERS, *FLOATS])
def test_a_value_of_the_wrong_type_is_named(type_: str, wrong: Any, everything: Any) -> None:
    text = encode_error(everything, everything.Everything(**{f"one_{type_}": wrong}))
    assert text.startswith(f"Everything.one_{type_}: expected ")
    assert type_ in text.partition("expected ")[2]
    assert "got " in text


@pytest.mark.parametrize("type_", INTEGERS)
def test_a_float_is_no_integer(type_: str, everything: Any) -> None:
    text = encode_error(everything, everything.Everything(**{f"one_{type_}": 1.0}))
    assert text == f"Everything.one_{type_}: expected an integer, got the float 1.0"


@pytest.mark.parametrize("wrong", [2, -1, 0.5, 1.0, 256, math.nan, "True", None, [], (), b"\1"], ids=repr)
def test_what_is_no_bool_is_named(wrong: Any, px4_types: Any, everything: Any) -> None:
    """1.0 is an error too, whether or not the message has other bools."""
    assert encode_error(px4_types, px4_types.VehicleStatus(failsafe=wrong)).startswith("VehicleStatus.failsafe: ")
    assert encode_error(px4_types, px4_types.VehicleCommand(from_external=wrong)).startswith(
        "VehicleCommand.from_external: expected a bool"
    )
    text = encode_error(everything, everything.Everything(few_bool=(True, wrong, False)))
    assert text.startswith("Everything.few_bool[1]: expected a bool")


@pytest.mark.parametrize("given_", [True, False, 1, 0])
def test_bools_and_their_numbers_are_bools(given_: Any, px4_types: Any) -> None:
    decoded = px4_types.VehicleStatus.decode(px4_types.VehicleStatus(failsafe=given_).encode())
    assert decoded.failsafe is bool(given_)


WRONG_LENGTHS = [
    ("SensorCombined", "gyro_rad", (0.0, 0.0), "expected 3 values, got 2"),
    ("SensorCombined", "gyro_rad", [0.0] * 4, "expected 3 values, got 4"),
    ("SensorCombined", "gyro_rad", (), "expected 3 values, got 0"),
    ("SensorCombined", "gyro_rad", 0.5, "expected 3 values, got one: 0.5"),
    ("SensorCombined", "gyro_rad", None, "expected 3 values, got one: None"),
    ("DebugKeyValue", "key", b"", "expected 10 bytes, got 0"),
    ("DebugKeyValue", "key", b"123456789", "expected 10 bytes, got 9"),
    ("DebugKeyValue", "key", b"12345678901", "expected 10 bytes, got 11"),
    ("DebugKeyValue", "key", bytearray(11), "expected 10 bytes, got 11"),
    ("DebugKeyValue", "key", "1234567890", "expected 10 bytes, got '1234567890'"),
    ("DebugKeyValue", "key", [0] * 10, "expected 10 bytes, got a list of 10"),
    ("DebugKeyValue", "key", None, "expected 10 bytes, got None"),
    ("DebugArray", "data", array.array("f", [0.0] * 57), "expected 58 values, got 57"),
    ("DebugArray", "data", array.array("f", [0.0] * 59), "expected 58 values, got 59"),
    ("DebugArray", "data", array.array("d", [0.0] * 59), "expected 58 values, got 59"),
    ("DebugArray", "data", array.array("f"), "expected 58 values, got 0"),
    ("DebugArray", "data", [0.0] * 57, "expected 58 values, got 57"),
    ("DebugArray", "data", 1, "expected 58 values, got one: 1"),
    ("EscStatus", "esc", (), "expected 12 values, got 0"),
    ("EscStatus", "esc", 8, "expected 12 values, got one: 8"),
]


@pytest.mark.parametrize(("name", "field", "value", "problem"), WRONG_LENGTHS)
def test_an_array_of_the_wrong_length_is_an_error(
    name: str, field: str, value: Any, problem: str, px4_types: Any
) -> None:
    text = encode_error(px4_types, assigned(getattr(px4_types, name)(), field, value))
    assert text.startswith(f"{name}.{field}: {problem}")


def assigned(message: Any, field: str, value: Any) -> Any:
    """Return `message` with a field set to a value that the constructor would have replaced."""
    setattr(message, field, value)
    return message


def test_two_arrays_cannot_make_up_for_each_other(px4_types: Any) -> None:
    """Arrays of four and two values have as many values in total as two arrays of three."""
    message = px4_types.SensorCombined(gyro_rad=(0.0,) * 4, accelerometer_m_s2=(0.0,) * 2)
    assert encode_error(px4_types, message) == "SensorCombined.gyro_rad: expected 3 values, got 4"


@pytest.mark.parametrize("code", ["q", "Q", "d"])
def test_the_type_of_an_array_never_stands_in_for_its_values(code: str, everything: Any) -> None:
    message = everything.Everything(many_int32=array.array(code, [2**40] * 20))
    kind = "an integer" if code in "fd" else "int32, "
    assert encode_error(everything, message).startswith(f"Everything.many_int32[0]: expected {kind}")


@pytest.mark.parametrize("wrong", ["other", None, 5, "a dictionary"])
def test_a_nested_value_of_the_wrong_type_is_named(wrong: Any, px4_types: Any) -> None:
    given_ = {"other": px4_types.DebugValue(timestamp=1), "a dictionary": {"timestamp": 1}}.get(wrong, wrong)
    triplet = assigned(px4_types.PositionSetpointTriplet(), "current", given_)
    text = encode_error(px4_types, triplet)
    assert text.startswith("PositionSetpointTriplet.current: expected PositionSetpoint, got ")
    reports = [px4_types.EscReport() for _ in range(12)]
    reports[3] = given_
    text = encode_error(px4_types, px4_types.EscStatus(esc=reports))
    assert text.startswith("EscStatus.esc[3]: expected EscReport, got ")


def test_a_wrong_value_in_a_nested_message_is_named_by_its_path(px4_types: Any) -> None:
    status = px4_types.EscStatus()
    status.esc[5].esc_rpm = 2**31
    expected = f"EscStatus.esc[5].esc_rpm: expected int32, {-(2**31)} to {2**31 - 1}, got {2**31}"
    assert encode_error(px4_types, status) == expected


@pytest.mark.parametrize("name", SOME)
def test_a_field_that_is_not_set_is_named(name: str, px4_types: Any) -> None:
    for field in getattr(px4_types, name).__msg__.fields:
        message = getattr(px4_types, name)()
        delattr(message, field.name)
        text = encode_error(px4_types, message)
        assert text.startswith(f"{name}.{field.name}: expected {field.type}, ")


def test_a_field_of_a_nested_message_that_is_not_set_is_named(px4_types: Any) -> None:
    status = px4_types.EscStatus()
    del status.esc[0].esc_power
    assert encode_error(px4_types, status).startswith("EscStatus.esc[0].esc_power: expected int8, ")


def test_an_error_has_no_cause_to_distract_from_it(px4_types: Any) -> None:
    for call in (px4_types.DebugVect(x="1").encode, lambda: px4_types.DebugVect.decode(b"")):
        with pytest.raises(px4_types.cdr.CodecError) as caught:
            call()
        assert caught.value.__cause__ is None


# Topics


def test_orb_ids_are_numbers_in_the_order_of_names(px4_types: Any) -> None:
    orb_id = px4_types.topics.ORB_ID
    assert issubclass(orb_id, IntEnum)
    assert [member.value for member in orb_id] == list(range(len(orb_id)))
    assert [member.name for member in orb_id] == sorted(member.name for member in orb_id)
    assert orb_id(int(orb_id.vehicle_odometry)) is orb_id["vehicle_odometry"]


def test_every_topic_knows_its_id_and_message(px4_types: Any, embedded: Catalog) -> None:
    topics = px4_types.topics
    assert list(topics.UORB) == [member.name for member in topics.ORB_ID]
    owners = {topic: message for message in embedded.messages.values() for topic in message.topic_names}
    for name, topic in topics.UORB.items():
        assert (topic.name, topic.orb_id) == (name, topics.ORB_ID[name])
        assert topic.message is getattr(px4_types, owners[name].name)
        assert topic.queue_length == owners[name].queue_length
        assert name in topic.message.__msg__.topics


def test_every_topic_of_every_message_is_in_the_table(px4_types: Any) -> None:
    declared = {topic for name in NAMES for topic in getattr(px4_types, name).__msg__.topics}
    assert declared == set(px4_types.topics.UORB)


def test_endpoints_are_those_of_the_bridge(px4_types: Any, embedded: Catalog) -> None:
    endpoints = px4_types.topics.ENDPOINTS
    assert len(endpoints) == len(embedded.bridge)
    for endpoint, entry in zip(endpoints, embedded.bridge, strict=True):
        assert endpoint.direction == entry.direction.value
        assert endpoint.ros_name.startswith(entry.topic)
        assert endpoint.dds_name == f"rt{endpoint.ros_name}"
        assert endpoint.message is getattr(px4_types, entry.message_name)
        assert (endpoint.rate_limit_hz, endpoint.instance) == (entry.rate_limit_hz, entry.instance)
        assert endpoint.uorb_topic == entry.uorb_topic
        assert endpoint.format_request_name == entry.topic
        version = endpoint.message.__msg__.message_version
        assert endpoint.ros_name == entry.topic + (f"_v{version}" if version else "")
    assert [each.format_request_name for each in px4_types.topics.namespaced("uav_1")] == [
        entry.topic for entry in embedded.bridge
    ]
    last = endpoints[-1]
    assert (last.ros_name, last.message) == ("/fmu/in/aux_global_position_v1", px4_types.AuxGlobalPosition)


def test_an_endpoint_is_found_by_either_name(px4_types: Any) -> None:
    topics = px4_types.topics
    for endpoint in topics.ENDPOINTS:
        assert topics.endpoint(endpoint.ros_name) is endpoint
        assert topics.endpoint(endpoint.dds_name) is endpoint


@pytest.mark.parametrize(
    ("wrong", "near"),
    [
        ("/fmu/in/landing_gea", "/fmu/in/landing_gear"),
        ("rt/fmu/in/landing_gea", "rt/fmu/in/landing_gear"),
    ],
)
def test_an_unknown_endpoint_gets_a_suggestion(wrong: str, near: str, px4_types: Any) -> None:
    with pytest.raises(KeyError) as caught:
        px4_types.topics.endpoint(wrong)
    assert str(caught.value) == f"no endpoint '{wrong}', did you mean '{near}'?"


def test_an_unknown_endpoint_like_no_other_gets_no_suggestion(px4_types: Any) -> None:
    with pytest.raises(KeyError) as caught:
        px4_types.topics.endpoint("zzzzzz")
    assert str(caught.value) == "no endpoint 'zzzzzz'"


@pytest.mark.parametrize(
    ("namespace", "prefix"), [("uav_1", "/uav_1"), ("/uav_1", "/uav_1"), ("uav_1/", "/uav_1"), ("a/b", "/a/b")]
)
def test_a_namespace_goes_in_front_of_every_name(namespace: str, prefix: str, px4_types: Any) -> None:
    topics = px4_types.topics
    for endpoint, plain in zip(topics.namespaced(namespace), topics.ENDPOINTS, strict=True):
        assert endpoint.ros_name == prefix + plain.ros_name
        assert endpoint.dds_name == f"rt{prefix}{plain.ros_name}"
        assert endpoint.message is plain.message
        assert (endpoint.object_id, endpoint.direction) == (plain.object_id, plain.direction)
        assert endpoint.qos == plain.qos
    found = topics.namespaced(namespace)
    assert [*found.out, *found.in_] == [*found]
    assert found.out.vehicle_status.ros_name == f"{prefix}/fmu/out/vehicle_status_v4"
    assert pickle.loads(pickle.dumps(found)) == copy.copy(found) == found  # noqa: S301 - our own bytes


@pytest.mark.parametrize("wrong", ["", "/", "1uav", "uav 1", "uav-1", "a//b", "../a", "uav\n", "ü"])
def test_what_is_no_namespace_is_refused(wrong: str, px4_types: Any) -> None:
    with pytest.raises(ValueError, match="is not a valid namespace"):
        px4_types.topics.namespaced(wrong)


def test_both_ends_of_every_endpoint_get_on_with_each_other(px4_types: Any) -> None:
    """A reader that requests more than its writer offers receives nothing."""
    for endpoint in px4_types.topics.ENDPOINTS:
        writer, reader = endpoint.qos.writer, endpoint.qos.reader
        assert reader.reliability == "BEST_EFFORT" or writer.reliability == "RELIABLE"
        assert reader.durability == "VOLATILE" or writer.durability == "TRANSIENT_LOCAL"


def test_px4_s_end_of_every_endpoint_is_what_px4_does(px4_types: Any) -> None:
    """Writers: BEST_EFFORT, TRANSIENT_LOCAL, KEEP_LAST. Readers: VOLATILE, as deep as the queues of their sources."""
    for endpoint in px4_types.topics.ENDPOINTS:
        px4 = endpoint.qos.writer if endpoint.direction == "out" else endpoint.qos.reader
        assert (px4.reliability, px4.history) == ("BEST_EFFORT", "KEEP_LAST")
        assert px4.durability == ("TRANSIENT_LOCAL" if endpoint.direction == "out" else "VOLATILE")
        queue_length = getattr(endpoint.message, "ORB_QUEUE_LENGTH", 1)
        assert endpoint.direction == "out" or px4.depth == (endpoint.max_instances or 2) * queue_length


def test_an_endpoint_shows_its_names_in_dds(px4_types: Any) -> None:
    endpoint = px4_types.topics.out.vehicle_status
    assert repr(endpoint).startswith(
        "Endpoint(direction='out', ros_name='/fmu/out/vehicle_status_v4', dds_name='rt/fmu/out/vehicle_status_v4', "
    )
    assert endpoint.dds_type == "px4_msgs::msg::dds_::VehicleStatus_"


def test_topics_exports_its_public_names_only(px4_types: Any) -> None:
    topics: ModuleType = px4_types.topics
    classes = {"Endpoint", "Qos", "QosPair", "UorbTopic"}
    functions = {"endpoint", "namespaced", "versions_of"}
    assert set(topics.__all__) == {"ENDPOINTS", "ORB_ID", "UORB", *classes, *functions, "in_", "out"} == {*dir(topics)}
    tree = ast.parse(Path(str(topics.__file__)).read_text(encoding="utf-8"))
    assert ast.get_docstring(tree)


# --- Messages in third-party tools


def test_annotations_can_be_evaluated(px4_types: Any) -> None:
    """pydantic, cattrs and Sphinx evaluate annotations; names for type checkers are also available at run time."""
    for name in ("SensorCombined", "ObstacleDistance", "EscStatus", "OnboardComputerStatus"):
        message_type = getattr(px4_types, name)
        hints = typing.get_type_hints(message_type)
        assert set(message_type.__match_args__) <= hints.keys()
        assert typing.get_type_hints(message_type.__init__).keys() >= set(message_type.__match_args__)
        assert inspect.signature(message_type.decode, eval_str=True).return_annotation is message_type


def test_messages_are_printed_prettily(px4_types: Any) -> None:
    messages = [px4_types.VehicleStatus(), px4_types.EscStatus()]
    assert "VehicleStatus(timestamp=0" in pprint.pformat(messages)


def test_help_names_topics_and_units(px4_types: Any) -> None:
    text = inspect.getdoc(px4_types.SensorCombined) or ""
    assert "gyro_rad [rad/s]" in text
    assert "uORB topic: sensor_combined" in text
