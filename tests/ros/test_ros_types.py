"""Tests of types that are installed for rclpy, compared with the definitions of a vehicle."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.ros.types import differences, installed, spelled
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import import_package, write_definitions
from support.ros_types import class_with, fields_of, px4_msgs_of


def classes(package: Any) -> dict[str, Any]:
    """Return the messages of all topics: importing all messages of a package takes seconds."""
    return {endpoint.message.__name__: endpoint.message for endpoint in package.topics.ENDPOINTS}


def test_types_have_the_names_of_rosidl() -> None:
    assert spelled("float32[3]") == "float[3]"
    assert spelled("bool") == "boolean"
    assert spelled("uint8[]") == "sequence<uint8>"
    assert spelled("byte[<=4]") == "sequence<octet, 4>"
    assert spelled("string<=10") == "string<10>"
    assert spelled("string<=10[<=2]") == "sequence<string<10>, 2>"


def test_a_px4_msgs_of_the_release_is_equal(px4_types: Any) -> None:
    found = classes(px4_types)
    find = px4_msgs_of(found.values())
    assert len(found) == 63
    assert {name for name, cls in found.items() if differences(cls, find(cls.__msg__.ros_type), find)} == set()


def test_types_are_equal_if_and_only_if_their_hashes_are(px4_types: Any) -> None:
    """RIHS01, which rosidl computes, is the reference. The pairs are messages of two releases with the same name."""
    new, old = (classes(package) for package in (px4_types, package_of("v1.15")))
    find = px4_msgs_of(old.values())
    equal = []
    for name in sorted(new.keys() & old.keys()):
        is_equal = new[name].__msg__.type_hash == old[name].__msg__.type_hash
        assert (differences(new[name], find(f"px4_msgs/msg/{name}"), find) == ()) == is_equal
        equal.append(is_equal)
    assert 10 < sum(equal) < len(equal) - 10


@pytest.mark.parametrize("seed", range(20))
def test_any_change_of_a_field_is_found_and_named(px4_types: Any, seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311 - not for secrets
    cls = chance.choice([cls for cls in classes(px4_types).values() if len(cls.__msg__.fields) > 2])
    fields = fields_of(cls.__msg__.definition)
    find = px4_msgs_of([cls])
    name = chance.choice([*fields])

    def changed(items: list[tuple[str, str]]) -> tuple[str, ...]:
        return differences(cls, class_with(dict(items)), find)

    items = [*fields.items()]
    assert changed([item for item in items if item[0] != name]) == (f"no field '{name}'",)
    assert changed([*items, ("more", "uint8")]) == ("a further field 'more'",)
    assert changed([(each, "wstring" if each == name else of) for each, of in items]) == (
        f"'{name}' is wstring instead of {fields[name].removeprefix('px4_msgs/')}",
    )
    assert changed(items[::-1]) == ("the fields in another order",)
    assert changed(items) == ()


def test_a_nested_message_is_compared_too(px4_types: Any) -> None:
    cls = px4_types.EscStatus
    find = px4_msgs_of([cls])
    report = fields_of(px4_types.EscReport.__msg__.definition)
    report.pop("esc_rpm")

    def without_rpm(ros_type: str) -> Any:
        return class_with(report) if ros_type == "px4_msgs/msg/EscReport" else find(ros_type)

    assert differences(cls, find("px4_msgs/msg/EscStatus"), without_rpm) == ("no field 'esc.esc_rpm'",)
    assert differences(cls, find("px4_msgs/msg/EscStatus"), lambda _: None) == (
        "'esc' is px4_msgs/EscReport[12] instead of EscReport[12]",
    )


def test_sequences_and_strings(tmp_path: Path) -> None:
    text = "string<=10 name\nuint8[] data\nfloat64[<=3] axes\nwstring[2] labels\n"
    px4 = write_definitions(tmp_path / "px4", {"msg/Wind.msg": "uint64 timestamp\n"})
    folder = write_definitions(tmp_path / "a_msgs", {"msg/Mixed.msg": text})
    package = import_package(read_catalog(find_sources(str(px4), (f"a_msgs={folder}",))), tmp_path).a_msgs.msg
    fields = {"name": "string<10>", "data": "sequence<uint8>", "axes": "sequence<double, 3>", "labels": "wstring[2]"}
    assert differences(package.Mixed, class_with(fields)) == ()
    assert len(differences(package.Mixed, class_with({**fields, "data": "uint8[3]", "axes": "sequence<double>"}))) == 2


def test_what_is_not_installed_is_none() -> None:
    assert installed("no_such_msgs/msg/Nothing") is None
