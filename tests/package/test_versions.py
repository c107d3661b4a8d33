"""Tests of several versions of a message: types of archived versions, conversion, and lookup by topic name.

Real trees show that the types match the firmware; small definitions of our own show every rule.
"""

from __future__ import annotations

import importlib
import itertools
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import textwrap
from array import array
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest

from msggen.cli import DONE, FAILED, FINDINGS, main
from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES, STRINGS
from msggen.generate.python.package import list_package, render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import Sources, find_sources, with_archived
from support.catalogs import import_package, write_definitions
from support.checkers import mypy
from support.examples import by_day
from support.imports import HEAVY
from support.random_definitions import values_of
from support.reference import HEADERS, serialize, to_object, to_values
from support.repository import ROOT, copied, shared
from support.samples import HEADER, plain, values_by_chance
from support.translations import HEADERS as TRANSLATIONS
from support.translations import class_of

PAGE = (ROOT / "docs" / "versions.md").read_text(encoding="utf-8")
ARCHIVE = "msg/px4_msgs_old/msg"
STAMP = "uint64 timestamp\n"


def version(number: int) -> str:
    """Return the line that declares the version of a definition."""
    return f"uint32 MESSAGE_VERSION = {number}\n"


def catalog_with_archived(tree: Path, release: str | None = None) -> Catalog:
    return read_catalog(with_archived(find_sources(str(tree), release=release)))


def package_of(files: dict[str, str], folder: Path) -> Any:
    """Return the package of a tree with these files, archived versions included."""
    return import_package(catalog_with_archived(write_definitions(folder / "in", files)), folder / "out")


# --- Real trees


class Tree(NamedTuple):
    """A release of the firmware with its archived versions."""

    release: str
    catalog: Catalog
    package: Any

    @property
    def topics(self) -> Any:
        return importlib.import_module(f"{self.package.__name__}.topics")

    @property
    def archived(self) -> list[Message]:
        return list(self.catalog.archived.values())


@pytest.fixture(scope="module")
def tree_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Tree]:
    """A function that reads and builds each release once."""

    @cache
    def tree_of(release: str) -> Tree:
        catalog = catalog_with_archived(shared(f"firmware/{release}"))
        return Tree(release, catalog, import_package(catalog, tmp_path_factory.mktemp("tree")))

    return tree_of


@pytest.fixture(params=[*(pytest.param(each, marks=pytest.mark.night) for each in ("v1.16", "v1.17")), "main-2026-03"])
def tree(request: pytest.FixtureRequest, tree_of: Callable[[str], Tree]) -> Tree:
    return tree_of(request.param)


def oracle(name: str) -> Any:
    return json.loads(shared(f"oracles/{name}.json").read_text())


@pytest.mark.slow
def test_every_archived_definition_of_a_tree_has_a_type(tree: Tree) -> None:
    files = sorted(path.stem for path in shared(f"firmware/{tree.release}").joinpath(ARCHIVE).glob("*.msg"))
    assert sorted(message.name for message in tree.archived) == files
    assert set(files) <= set(tree.package.__all__) & set(tree.package.msg.__all__)
    for name in files:
        assert getattr(tree.package, name) is getattr(tree.package.msg, name)
        assert getattr(tree.package, name).__msg__.name == getattr(tree.package, name).__name__ == name


@pytest.mark.slow
def test_every_archived_version_of_a_tree_decodes_and_encodes(tree: Tree) -> None:
    chance = Random(5)  # noqa: S311 - not used for security
    for message in tree.archived:
        cls = getattr(tree.package, message.name)
        for _ in range(20):
            values = values_by_chance(tree.catalog, message, chance)
            usual = serialize(tree.catalog, message, values, "little", 1)
            for encoding in HEADERS:
                decoded = cls.decode(serialize(tree.catalog, message, values, *encoding))
                assert plain(to_values(tree.catalog, message, decoded)) == plain(values)
                assert decoded.encode() == usual


OTHER_THAN_RELEASED = {"BatteryStatusV0", "VehicleLocalPositionV0"}
"""The archived version 0 in v1.17 and later differs from the definition in v1.16 (docs/bump.md)."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("release", "earlier", "number"),
    [("v1.17", "v1.16", 8), ("main-2026-03", "v1.16", 14), ("main-2026-03", "v1.17", 6)],
)
def test_an_archived_version_is_to_the_wire_what_the_earlier_release_had(
    release: str, earlier: str, number: int, tree_of: Callable[[str], Tree]
) -> None:
    """Compare with the firmware's own hashes, sizes and types of the release in which the version was current."""
    tree = tree_of(release)
    measured, type_hashes = oracle(f"uorb-{earlier}")["messages"], oracle(f"rihs01-{earlier}")
    then = read_catalog(find_sources(str(shared(f"firmware/{earlier}"))))
    compared = 0
    for archived in tree.archived:
        name = archived.released_as[1]
        if then.messages[archived.version_of].message_version != archived.message_version:
            continue
        about = getattr(tree.package, archived.name).__msg__
        assert (about.ros_type, about.dds_type) == (f"px4_msgs/msg/{name}", f"px4_msgs::msg::dds_::{name}_")
        assert (about.message_version, about.topics) == (archived.message_version, ())
        found = (about.message_hash, about.type_hash, about.cdr_size, about.struct_size)
        expected = measured[name]
        as_released = (
            expected["message_hash"],
            type_hashes[name],
            expected["cdr_size"],
            expected["struct_size_no_padding"],
        )
        assert (found == as_released) == (archived.name not in OTHER_THAN_RELEASED)
        compared += 1
    assert compared == number


def differing(sources: Sources) -> set[tuple[str, str]]:
    """Return the archived versions that differ from an embedded release, each with this release."""
    notices = read_catalog(with_archived(sources)).notices
    texts = (re.match(r"'(\w+)' differs from version \d+ in PX4 (v[\d.]+): ", each.message) for each in notices)
    return {(text[1], text[2]) for text in texts if text}


@pytest.mark.parametrize("release", ["v1.16", "v1.17", "v1.18"])
def test_archived_versions_that_their_release_did_not_have_are_warnings(release: str) -> None:
    expected = set() if release == "v1.16" else {(name, "v1.16") for name in OTHER_THAN_RELEASED}
    assert differing(find_sources(f"embedded:{release}")) == expected


def test_an_archived_version_differs_if_a_message_in_it_does(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "msg", tmp_path / "msg")
    nested = tmp_path / ARCHIVE / "EventV0.msg"
    nested.write_text(nested.read_text().replace("uint16 event_sequence", "uint32 event_sequence"))
    before = differing(find_sources(str(ROOT)))
    assert differing(find_sources(str(tmp_path))) - before == {("ArmingCheckReplyV0", "v1.16")}


UNVERSIONED = {"EstimatorStatusFlags", "FailsafeFlags", "SensorGps", "TelemetryStatus"}
"""Messages that changed between these releases without a version number, so nothing shows the change."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("release", "earlier", "without", "same"),
    [("v1.17", "v1.16", 41, 46), ("main-2026-03", "v1.16", 34, 44), ("main-2026-03", "v1.17", 57, 62)],
)
def test_the_topics_of_an_earlier_release_lead_to_its_types(
    release: str, earlier: str, without: int, same: int, tree_of: Callable[[str], Tree]
) -> None:
    """Without archived versions, only the current types match. docs/versions.md has the counts of two releases."""
    topics = tree_of(release).topics
    measured = oracle(f"uorb-{earlier}")["messages"]
    agreeing, other, unknown = [], set(), set()
    rows = oracle(f"dds-{earlier}")
    for row in rows:
        try:
            endpoint = topics.endpoint(row["dds_topic"])
        except KeyError:
            unknown.add(row["yaml_topic"])
            continue
        about = endpoint.message.__msg__
        assert (endpoint.dds_name, about.dds_type) == (row["dds_topic"], row["dds_type"])
        assert about.message_version == row["message_version"]
        if about.message_hash == measured[row["type"]]["message_hash"]:
            agreeing.append(endpoint)
        else:
            other.add(about.name)
    assert len(agreeing) == same
    assert len([endpoint for endpoint in agreeing if endpoint in topics.ENDPOINTS]) == without
    if release == "v1.17":
        shown = (
            f"a package of v1.17 has the same definition as {earlier} for {same} of {len(rows)} topics, and {without}"
        )
        assert shown in PAGE
    assert other <= UNVERSIONED | OTHER_THAN_RELEASED
    assert unknown == ({"/fmu/in/aux_global_position"} if release == "main-2026-03" else set())


def chains(tree: Tree) -> list[tuple[Message, ...]]:
    """Return all messages that have several versions, each as the tuple of its versions."""
    found = [tree.catalog.versions(message) for message in tree.catalog.messages.values()]
    return [versions for versions in found if len(versions) > 1]


def test_versions_lead_from_the_oldest_to_the_current_and_back(tree: Tree) -> None:
    """Fields with the same name in two definitions keep their value; only fields that one of them lacks are lost."""
    chance = Random(6)  # noqa: S311 - not used for security
    assert len(chains(tree)) == {"v1.16": 1, "v1.17": 9, "main-2026-03": 13}[tree.release]
    for versions in chains(tree):
        for start, steps, method in (
            (versions[0], versions[1:], "upgrade"),
            (versions[-1], versions[-2::-1], "downgrade"),
        ):
            values = values_by_chance(tree.catalog, start, chance)
            message, before = to_object(tree.package, tree.catalog, start, values), start
            for after in steps:
                names = [{field.name for field in definition.fields} for definition in (before, after)]
                converted = getattr(message, method)()
                assert type(converted.message) is getattr(tree.package, after.name)
                assert set(converted.dropped) == names[0] - names[1]
                assert set(converted.defaulted) == names[1] - names[0]
                for name in names[0] & names[1]:
                    assert plain(getattr(converted.message, name)) == plain(getattr(message, name))
                message, before = converted.message, after
            assert not hasattr(message, method)


def test_what_goes_down_and_up_again_keeps_all_that_both_have(tree: Tree) -> None:
    chance = Random(7)  # noqa: S311 - not used for security
    for versions in chains(tree):
        for older, newer in itertools.pairwise(versions):
            for _ in range(20):
                values = values_by_chance(tree.catalog, newer, chance)
                message = to_object(tree.package, tree.catalog, newer, values)
                again = message.downgrade().message.upgrade().message
                assert type(again) is type(message)
                for name in {field.name for field in older.fields} & {field.name for field in newer.fields}:
                    assert plain(getattr(again, name)) == plain(getattr(message, name))


def test_an_archived_definition_of_the_current_version_has_no_neighbours(tree_of: Callable[[str], Tree]) -> None:
    """Main archives version 0 of VehicleGlobalPosition, which is current, because AuxGlobalPosition had that type."""
    package = tree_of("main-2026-03").package
    for name in ("VehicleGlobalPosition", "VehicleGlobalPositionV0"):
        assert not hasattr(getattr(package, name), "upgrade")
        assert not hasattr(getattr(package, name), "downgrade")


def test_a_program_decodes_the_samples_of_two_vehicles_with_different_firmware(
    tree_of: Callable[[str], Tree],
) -> None:
    """The serializers of v1.16 and v1.17 wrote the samples; the program knows only topic names."""
    topics = tree_of("v1.17").topics
    same, versions = {"v1.16": 0, "v1.17": 0}, set()
    for firmware, namespace in (("v1.16", "/uav_1"), ("v1.17", "/uav_2")):
        names = {row["type"]: row["dds_topic"].removeprefix("rt") for row in oracle(f"dds-{firmware}")}
        for vector in oracle(f"cdr-{firmware}"):
            name = names.get(vector["type"])
            message_type = topics.endpoint(f"{namespace}{name}").message if name else None
            if message_type is None or message_type.__name__ in UNVERSIONED | OTHER_THAN_RELEASED:
                continue
            stale = bytes.fromhex(vector["hex"])
            clean = bytes(0 if index in vector["padding"] else byte for index, byte in enumerate(stale))
            assert message_type.decode(HEADER + stale).encode() == HEADER + clean
            same[firmware] += 1
            versions.add(message_type.__name__)
    assert same == {"v1.16": 5 * 38, "v1.17": 5 * 54}
    assert {"HomePositionV0", "HomePosition", "ArmingCheckReplyV0", "ArmingCheckReply"} <= versions


# --- Rules of a single field


class Rule(NamedTuple):
    """A value of a field in the older version, and its value in the newer version, or LOST."""

    older: str
    newer: str
    value: Any
    expected: Any


LOST = object()
NAN, INF = math.nan, math.inf

RULES = [
    # the same type
    Rule("uint8", "uint8", 7, 7),
    Rule("bool[2]", "bool[2]", (True, False), (True, False)),
    Rule("float32", "float32", 0.1, struct.unpack("f", struct.pack("f", 0.1))[0]),
    Rule("char[5]", "char[5]", b"hello", b"hello"),
    Rule("float32[3]", "float32[3]", (1.5, NAN, -INF), (1.5, NAN, -INF)),
    Rule("uint16[20]", "uint16[20]", tuple(range(20)), array("H", range(20))),
    # integers: values that fit, and values that do not
    Rule("uint8", "uint16", 255, 255),
    Rule("uint16", "uint8", 255, 255),
    Rule("uint16", "uint8", 256, LOST),
    Rule("int8", "uint8", -1, LOST),
    Rule("int8", "uint64", 127, 127),
    Rule("uint64", "int64", 2**63 - 1, 2**63 - 1),
    Rule("uint64", "int64", 2**63, LOST),
    Rule("char", "uint8", 65, 65),
    Rule("byte", "int8", 128, LOST),
    # floats: values that stay exact, and values that would be rounded
    Rule("float32", "float64", 0.1, struct.unpack("f", struct.pack("f", 0.1))[0]),
    Rule("float64", "float32", 0.5, 0.5),
    Rule("float64", "float32", 0.1, LOST),
    Rule("float64", "float32", 1e300, LOST),
    Rule("float64", "float32", NAN, NAN),
    Rule("float64", "float32", -INF, -INF),
    # a different kind of type
    Rule("uint8", "bool", 1, LOST),
    Rule("uint8", "float32", 1, LOST),
    Rule("float32", "int32", 1.0, LOST),
    Rule("uint8", "uint8[1]", 7, LOST),
    Rule("uint8[1]", "uint8", b"\7", LOST),
    Rule("uint8", "Inner", 7, LOST),
    # arrays: converted as a whole
    Rule("uint8[3]", "uint8[4]", b"abc", LOST),
    Rule("uint8[3]", "uint16[3]", b"abc", (97, 98, 99)),
    Rule("uint16[3]", "uint8[3]", (1, 2, 255), b"\1\2\xff"),
    Rule("uint16[3]", "uint8[3]", (1, 2, 256), LOST),
    Rule("int8[2]", "char[2]", (65, -1), LOST),
    Rule("uint8[20]", "int32[20]", bytes(range(20)), array("i", range(20))),
    Rule("int32[20]", "uint8[20]", tuple(range(20)), bytes(range(20))),
    Rule("float32[16]", "float64[16]", (0.5,) * 16, array("d", [0.5] * 16)),
    Rule("float64[16]", "float32[16]", (*[0.5] * 15, 0.1), LOST),
    Rule("bool[2]", "uint8[2]", (True, False), LOST),
    # sequences and strings: converted if the value fits
    Rule("uint8[3]", "uint8[]", b"abc", b"abc"),
    Rule("uint8[]", "uint8[3]", b"abc", b"abc"),
    Rule("uint8[]", "uint8[3]", b"ab", LOST),
    Rule("uint8[]", "uint16[<=3]", b"abc", array("H", [97, 98, 99])),
    Rule("uint8[]", "uint16[<=3]", b"abcd", LOST),
    Rule("int32[<=4]", "int16[]", (1, 2, 2**15), LOST),
    Rule("bool[<=2]", "bool[]", (True,), (True,)),
    Rule("uint8", "uint8[]", 7, LOST),
    Rule("string", "string<=5", "hello", "hello"),
    Rule("string", "string<=5", "hello!", LOST),
    Rule("string<=5", "wstring", "h\u00e9llo", "h\u00e9llo"),
    Rule("string[]", "string<=2[2]", ("a", "bb"), ("a", "bb")),
    Rule("string[]", "string<=2[2]", ("a", "bbb"), LOST),
    Rule("string", "char[5]", "hello", LOST),
]


@pytest.fixture(scope="module")
def ruled(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The package with a message for each rule, numbered like the rules."""
    files = {"msg/Inner.msg": STAMP}
    for number, rule in enumerate(RULES):
        files[f"{ARCHIVE}/Rule{number}V0.msg"] = f"{version(0)}{STAMP}{rule.older} value\n"
        files[f"msg/versioned/Rule{number}.msg"] = f"{version(1)}{rule.newer} value\n{STAMP}"
    return package_of(files, tmp_path_factory.mktemp("ruled"))


@pytest.mark.parametrize("number", range(len(RULES)), ids=[f"{r.older} {r.value} to {r.newer}" for r in RULES])
def test_a_value_is_carried_where_the_other_field_holds_it(number: int, ruled: Any) -> None:
    rule = RULES[number]
    newer = getattr(ruled, f"Rule{number}")
    converted = getattr(ruled, f"Rule{number}V0")(timestamp=5, value=rule.value).upgrade()
    lost = ("value",) if rule.expected is LOST else ()
    assert (converted.dropped, converted.defaulted, converted.message.timestamp) == (lost, lost, 5)
    expected = newer().value if rule.expected is LOST else rule.expected
    assert plain(converted.message.value) == plain(expected)
    assert type(converted.message.value) is type(expected)
    assert newer.decode(converted.message.encode()) == converted.message


@pytest.mark.parametrize("number", [number for number, rule in enumerate(RULES) if rule.expected is not LOST])
def test_what_was_carried_comes_back(number: int, ruled: Any) -> None:
    old = getattr(ruled, f"Rule{number}V0")(timestamp=5, value=RULES[number].value)
    back = old.upgrade().message.downgrade()
    assert (back.message, back.dropped, back.defaulted) == (old, (), ())


# --- Dropped and defaulted fields, and their names


NESTED = {
    f"{ARCHIVE}/EventV0.msg": f"{version(0)}{STAMP}uint32 id\nuint8 level\nuint8 gone\n",
    f"{ARCHIVE}/ReplyV0.msg": (
        f"{version(0)}uint8 first\n{STAMP}EventV0 main\nEventV0[3] events\n"
        "EventV0[2] fewer\nOtherV0 other\nuint8 last\n"
    ),
    f"{ARCHIVE}/OtherV0.msg": f"{version(0)}uint8 x\n",
    f"{ARCHIVE}/ThirdV0.msg": f"{version(0)}uint8 x\n",
    "msg/versioned/Event.msg": f"{version(1)}{STAMP}uint16 id\nuint8 added\nuint8 level\n",
    "msg/versioned/Other.msg": f"{version(1)}{STAMP}uint8 x\n",
    "msg/versioned/Third.msg": f"{version(1)}{STAMP}uint8 x\n",
    "msg/versioned/Reply.msg": (
        f"{version(1)}{STAMP}uint8 z\nEvent main\nuint8 a\nEvent[3] events\nEvent[3] fewer\nThird other\n"
    ),
}


@pytest.fixture(scope="module")
def nested(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return package_of(NESTED, tmp_path_factory.mktemp("nested"))


def test_nested_messages_are_carried_field_by_field_and_named_by_their_path(nested: Any) -> None:
    """Paths are in the order of the definitions; an array with another length or another message is lost as a whole."""
    events = (nested.EventV0(1, 2, 3, 4), nested.EventV0(5, 6, 7, 8), nested.EventV0(9, 10, 11, 12))
    old = nested.ReplyV0(first=1, timestamp=2, main=events[0], events=events, last=3)
    converted = old.upgrade()
    new = converted.message
    assert [(event.timestamp, event.id, event.level, event.added) for event in new.events] == [
        (1, 2, 3, 0),
        (5, 6, 7, 0),
        (9, 10, 11, 0),
    ]
    assert (new.timestamp, new.main.id, new.fewer, new.other) == (2, 2, (nested.Event(),) * 3, nested.Third())
    assert converted.dropped == ("first", "main.gone", "events.gone", "fewer", "other", "last")
    assert converted.defaulted == ("z", "main.added", "a", "events.added", "fewer", "other")


def test_a_nested_value_that_does_not_fit_is_named_once_and_the_others_are_carried(nested: Any) -> None:
    events = (nested.EventV0(id=1), nested.EventV0(id=2**16), nested.EventV0(id=2**31))
    converted = nested.ReplyV0(events=events).upgrade()
    assert [event.id for event in converted.message.events] == [1, 0, 0]
    assert converted.dropped.count("events.id") == converted.defaulted.count("events.id") == 1
    assert "main.id" not in converted.dropped


def test_an_archived_message_may_nest_a_current_one_by_its_full_name(tmp_path: Path) -> None:
    files = {
        f"{ARCHIVE}/LampV0.msg": f"{version(0)}{STAMP}px4_msgs/Fan fan\n",
        "msg/versioned/Lamp.msg": f"{version(1)}{STAMP}Fan fan\n",
        "msg/Fan.msg": STAMP,
    }
    package = package_of(files, tmp_path)
    old = package.LampV0(fan=package.Fan(timestamp=4))
    assert package.LampV0.decode(old.encode()) == old
    assert old.upgrade().message == package.Lamp(fan=package.Fan(timestamp=4))


def test_sequences_of_nested_messages_are_as_long_as_they_were(tmp_path: Path) -> None:
    files = {name: text for name, text in NESTED.items() if "Event" in name}
    files[f"{ARCHIVE}/ListV0.msg"] = f"{version(0)}{STAMP}EventV0[] many\nEventV0[<=2] few\nEventV0[2] two\n"
    files["msg/versioned/List.msg"] = f"{version(1)}{STAMP}Event[<=3] many\nEvent[1] few\nEvent[] two\n"
    package = package_of(files, tmp_path)
    event = package.EventV0(id=4)
    converted = package.ListV0(many=[event] * 3, few=[event] * 2, two=(event,) * 2).upgrade()
    new = converted.message
    assert [event.id for event in (*new.many, *new.few, *new.two)] == [4, 4, 4, 0, 4, 4]
    assert (converted.dropped, converted.defaulted) == (
        ("many.gone", "few", "two.gone"),
        ("many.added", "few", "two.added"),
    )
    assert package.ListV0(many=[event] * 4).upgrade().dropped[:1] == ("many",)
    assert package.ListV0().upgrade().message.many == ()


def test_a_default_of_the_definition_is_what_a_field_is_left_at(tmp_path: Path) -> None:
    package = package_of(
        {
            f"{ARCHIVE}/LampV0.msg": f"{version(0)}{STAMP}",
            "msg/versioned/Lamp.msg": f"{version(1)}{STAMP}uint8 mode 4\nfloat32[2] level [0.5, 1.0]\n",
        },
        tmp_path,
    )
    converted = package.LampV0(timestamp=1).upgrade()
    assert (converted.message.mode, converted.message.level) == (4, (0.5, 1.0))
    assert converted.defaulted == ("mode", "level")


def test_what_converting_gives_can_be_matched_compared_and_printed(nested: Any) -> None:
    versions = importlib.import_module(f"{nested.__name__}.versions")
    converted = nested.OtherV0(x=3).upgrade()
    match converted:
        case versions.Converted(message, (), ("timestamp",)):
            assert message == nested.Other(x=3)
        case _:
            pytest.fail(repr(converted))
    assert converted == nested.OtherV0(x=3).upgrade()
    assert repr(converted) == "Converted(message=Other(timestamp=0, x=3), dropped=(), defaulted=('timestamp',))"
    with pytest.raises(AttributeError):
        converted.dropped = ()


def test_the_other_message_has_nothing_in_common_with_the_given_one(nested: Any) -> None:
    old = nested.ReplyV0(events=(nested.EventV0(id=1), nested.EventV0(id=2), nested.EventV0(id=3)))
    new = old.upgrade().message
    new.events[0].level = 9
    assert old.events[0].level == 0
    again = old.upgrade().message
    assert again.events[0].level == 0


def test_a_large_array_is_not_shared_with_the_given_message(tmp_path: Path) -> None:
    files = {
        f"{ARCHIVE}/GustV0.msg": f"{version(0)}float32[20] x\n",
        "msg/Gust.msg": f"{version(1)}{STAMP}float32[20] x\n",
    }
    package = package_of(files, tmp_path)
    old = package.GustV0()
    old.upgrade().message.x[0] = 5.0
    assert old.x[0] == 0.0


def test_a_view_and_a_subclass_convert_like_any_message(nested: Any) -> None:
    class Special(nested.EventV0):  # type: ignore[misc]
        __slots__ = ()

    sample = nested.EventV0(1, 2, 3, 4).encode()
    expected = nested.EventV0(1, 2, 3, 4).upgrade()
    assert nested.EventV0.lazy(sample).upgrade() == expected
    assert Special(1, 2, 3, 4).upgrade() == expected


def test_a_message_that_could_not_be_encoded_cannot_be_converted_either(nested: Any) -> None:
    with pytest.raises(nested.EncodeError, match=r"EventV0\.id: expected uint32, 0 to 4294967295, got 'x'"):
        nested.EventV0(id="x").upgrade()
    with pytest.raises(nested.EncodeError, match=r"ReplyV0\.main\.level: expected uint8"):
        nested.ReplyV0(main=nested.EventV0(level=256)).upgrade()


def test_any_version_converts_to_any_other_and_to_nothing_else(tmp_path: Path) -> None:
    files = {
        f"{ARCHIVE}/LampV{number}.msg": f"{version(number)}{STAMP}uint8 only_{number}\nuint8 all\n" for number in (0, 2)
    }
    files["msg/Lamp.msg"] = f"{version(4)}{STAMP}uint8 all\n"
    files["msg/Fan.msg"] = f"{STAMP}uint8 all\n"
    package = package_of(files, tmp_path)
    convert = importlib.import_module(f"{package.__name__}.versions").convert
    converted = convert(package.LampV0(1, 2, 3), package.Lamp)
    assert (converted.message, converted.dropped, converted.defaulted) == (package.Lamp(1, 3), ("only_0",), ())
    assert convert(package.Lamp(1, 3), package.Lamp).message == package.Lamp(1, 3)
    with pytest.raises(TypeError, match="Fan is not a version of px4_msgs/msg/Lamp"):
        convert(package.LampV0(), package.Fan)


# --- Random definitions against a simple conversion


TYPES = ("bool", *INTEGERS, *FLOATS, "string", "string<=4", "wstring", *["Inner"] * 4, "Other", "")
SHAPES = ("", "", "", "[1]", "[3]", "[17]", "[]", "[<=1]", "[<=3]")
PAIRS = 60


def two_versions(chance: Random, name: str) -> dict[str, str]:
    """Return two versions of a message that share field names."""

    def fields(types: tuple[str, ...], names: str) -> str:
        chosen = [(chance.choice(types), field) for field in chance.sample(names, len(names))]
        return "".join(f"{type_}{chance.choice(SHAPES)} {field}\n" for type_, field in chosen if type_)

    old = tuple(re.sub("^(Inner|Other)$", r"\1V0", type_) for type_ in TYPES)
    return {
        f"{ARCHIVE}/{name}V0.msg": version(0) + STAMP + fields(old, "abcdef"),
        f"msg/versioned/{name}.msg": version(1) + STAMP + fields(TYPES, "abcdef"),
    }


@pytest.fixture(scope="module")
def random_pairs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Catalog, Any]:
    chance = Random(55)  # noqa: S311 - not used for security
    files = {
        f"{ARCHIVE}/InnerV0.msg": f"{version(0)}uint16 a\n{STAMP}float64 b\nuint8 c\nstring d\nbool[2] f\n",
        "msg/versioned/Inner.msg": f"{version(1)}uint8 e\nint8 c\n{STAMP}float32 b\nuint8 a\nstring<=2 d\nbool[2] f\n",
        f"{ARCHIVE}/OtherV0.msg": version(0) + STAMP,
        "msg/versioned/Other.msg": version(1) + STAMP,
    }
    for number in range(PAIRS):
        files |= two_versions(chance, f"Outer{number}x")
    folder = tmp_path_factory.mktemp("random")
    catalog = catalog_with_archived(write_definitions(folder / "in", files))
    return catalog, import_package(catalog, folder / "out")


@pytest.mark.slow
@by_day("number", range(PAIRS), 3)
def test_random_versions_convert_as_an_obvious_way_does(number: int, random_pairs: tuple[Catalog, Any]) -> None:
    catalog, package = random_pairs
    chance = Random(number)  # noqa: S311 - not used for security
    older, newer = catalog.versions(catalog.messages[f"px4_msgs/Outer{number}x"])
    for before, after, method in ((older, newer, "upgrade"), (newer, older, "downgrade")):
        zero = to_values(catalog, after, getattr(package, after.name)())
        for _ in range(20):
            values = values_of(catalog, before, chance)
            converted = getattr(to_object(package, catalog, before, values), method)()
            carried, dropped, defaulted = in_common(catalog, before, after, values)
            found = to_values(catalog, after, converted.message)
            assert plain_values(found) == plain_values({**zero, **carried})
            assert (set(converted.dropped), set(converted.defaulted)) == (dropped, defaulted)
            assert len(converted.dropped) == len(dropped)
            assert len(converted.defaulted) == len(defaulted)
            assert type(converted.message).decode(converted.message.encode()) == converted.message


def in_common(
    catalog: Catalog, old: Message, new: Message, values: dict[str, Any]
) -> tuple[dict[str, Any], set[str], set[str]]:
    """Return the values that `new` carries over, and the dropped and the defaulted fields, nested ones by path."""
    mine = {field.name: field.type for field in old.fields}
    theirs = {field.name: field.type for field in new.fields}
    carried: dict[str, Any] = {}
    dropped, defaulted = set(mine) - set(theirs), set(theirs) - set(mine)
    for name in set(mine) & set(theirs):
        is_single = mine[name].array is ArrayKind.SCALAR
        several = [values[name]] if is_single else values[name]
        if not has_room(theirs[name], None if is_single else len(several)):
            pass
        elif not mine[name].is_primitive and not theirs[name].is_primitive:
            inner = catalog.nested(old, mine[name]), catalog.nested(new, theirs[name])
            if inner[0].ros_type == inner[1].ros_type:
                parts = [in_common(catalog, *inner, one) for one in several]
                zero = {field.name: ZEROS[str(field.type)] for field in inner[1].fields}
                whole = [{**zero, **part[0]} for part in parts]
                carried[name] = whole[0] if is_single else whole
                dropped |= {f"{name}.{lost}" for part in parts for lost in part[1]}
                defaulted |= {f"{name}.{unset}" for part in parts for unset in part[2]}
                continue
        elif kind(mine[name]) == kind(theirs[name]) and all(holds(mine[name], theirs[name], one) for one in several):
            carried[name] = values[name]
            continue
        dropped.add(name)
        defaulted.add(name)
    return carried, dropped, defaulted


ZEROS: dict[str, Any] = {"string": "", "string<=2": "", "bool[2]": [False, False], "float32": 0.0, "float64": 0.0}
ZEROS |= dict.fromkeys(("uint8", "int8", "uint16", "uint64"), 0)
"""Zeros of the types in both versions of Inner."""


def has_room(type_: FieldType, count: int | None) -> bool:
    if count is None or type_.array is ArrayKind.SCALAR:
        return count is None and type_.array is ArrayKind.SCALAR
    at_most = type_.array is ArrayKind.BOUNDED and count <= type_.length
    return at_most or type_.array is ArrayKind.UNBOUNDED or (type_.array is ArrayKind.FIXED and count == type_.length)


def kind(type_: FieldType) -> str:
    kinds = {"integer": INTEGERS, "float": FLOATS, "text": STRINGS, "bool": ("bool",)}
    return next((name for name, types in kinds.items() if type_.name in types), "message")


def holds(mine: FieldType, theirs: FieldType, value: Any) -> bool:
    """Whether the type `theirs` can hold a value of a type of the same kind."""
    if theirs.name in INTEGERS:
        low, high = PRIMITIVES[theirs.name].integer_range
        return bool(low <= value <= high)
    if theirs.name in STRINGS:
        return theirs.string_bound is None or len(value) <= theirs.string_bound
    return (mine.name, theirs.name) != ("float64", "float32") or not math.isfinite(value) or is_float32(value)


def is_float32(value: float) -> bool:
    """Whether a float32 can represent a finite number exactly: in precision, smallest step and magnitude."""
    if value == 0:
        return True
    numerator, denominator = abs(value).as_integer_ratio()
    odd = numerator // (numerator & -numerator)
    return odd < 2**24 and denominator <= 2**149 and numerator < 2**128 * denominator


def plain_values(values: Any) -> Any:
    """Return values in a form in which NaN equals NaN, and 1 differs from True."""
    if isinstance(values, dict):
        return {name: plain_values(value) for name, value in values.items()}
    return [plain_values(value) for value in values] if isinstance(values, list) else repr(values)


# --- Neighbouring versions


def lamps(*archived: int, current: int | None, text: str = STAMP) -> dict[str, str]:
    """Return several versions of one message."""
    files = {f"{ARCHIVE}/LampV{number}.msg": f"{version(number)}{text}" for number in archived}
    files["msg/Fan.msg"] = STAMP
    return files | ({} if current is None else {"msg/Lamp.msg": f"{version(current)}{text}"})


@pytest.mark.parametrize(
    ("archived", "current", "chain"),
    [
        ((0,), 1, ["LampV0", "Lamp"]),
        ((0, 1, 2), 3, ["LampV0", "LampV1", "LampV2", "Lamp"]),
        ((0, 3, 10), 12, ["LampV0", "LampV3", "LampV10", "Lamp"]),
        ((2, 10, 9), 11, ["LampV2", "LampV9", "LampV10", "Lamp"]),
        ((0, 1), 1, ["LampV0", "Lamp"]),
        ((0, 2), 1, ["LampV0", "Lamp", "LampV2"]),
        ((0, 1), None, ["LampV0", "LampV1"]),
    ],
    ids=["one", "several", "gaps", "by number", "the current one archived", "one to come", "no current one"],
)
def test_neighbours_are_the_nearest_versions_that_there_are(
    archived: tuple[int, ...], current: int | None, chain: list[str], tmp_path: Path
) -> None:
    package = package_of(lamps(*archived, current=current), tmp_path)
    up = [getattr(package, chain[0])(timestamp=8)]
    while hasattr(up[-1], "upgrade"):
        up.append(up[-1].upgrade().message)
    down = [up[-1]]
    while hasattr(down[-1], "downgrade"):
        down.append(down[-1].downgrade().message)
    assert [type(message).__name__ for message in up] == chain
    assert [type(message).__name__ for message in down] == chain[::-1]
    assert {message.timestamp for message in up + down} == {8}


def test_a_message_whose_name_ends_like_a_version_is_kept_apart(tmp_path: Path) -> None:
    files = {
        f"{ARCHIVE}/LinkV2V0.msg": f"{version(0)}{STAMP}",
        "msg/LinkV2.msg": f"{version(1)}{STAMP}",
        "msg/Link.msg": STAMP,
    }
    package = package_of(files, tmp_path)
    assert type(package.LinkV2V0().upgrade().message) is package.LinkV2
    assert package.LinkV2V0.__msg__.ros_type == "px4_msgs/msg/LinkV2"
    assert not hasattr(package.Link, "downgrade")


def test_messages_without_other_versions_stay_as_they_are(tmp_path: Path) -> None:
    """Their modules do not change at all, so they cost no more; without versions, no new module is generated."""
    files = lamps(0, current=1)
    tree = write_definitions(tmp_path, files)
    without = render_package(read_catalog(find_sources(str(tree))), "lamps")
    having = render_package(catalog_with_archived(tree), "lamps")
    changed = {name for name in without if having[name] != without[name]}
    assert changed == {"__init__.py", "msg/__init__.py", "msg/_lamp.py"}
    assert having.keys() - without.keys() == {"versions.py", "translations.py", "msg/_lamp_v0.py"}
    assert list_package(catalog_with_archived(tree)) == tuple(having)
    assert "grade" not in without["msg/_lamp.py"]


def test_no_version_is_imported_before_it_is_asked_for(nested: Any) -> None:
    program = (
        f"import sys; import {nested.__name__} as package; message = package.Event()\n"
        f"print(*sorted(name for name in sys.modules if name.startswith(package.__name__)))"
    )
    folder = str(Path(nested.__file__).parent.parent)
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True)
    parts = {name.removeprefix(nested.__name__) for name in done.stdout.split()}
    assert parts == {"", ".cdr", ".msg", ".msg._event"}


# --- Topics


BRIDGE = """
publications:
  - {topic: /fmu/out/lamp, type: 'px4_msgs::msg::Lamp', rate_limit: 5}
  - {topic: /fmu/out/lamp, type: 'px4_msgs::msg::Lamp', instance: 1}
  - {topic: /fmu/out/fan, type: 'px4_msgs::msg::Fan'}
subscriptions:
  - {topic: /fmu/in/lamp, type: 'px4_msgs::msg::Lamp'}
subscriptions_multi:
  - {topic: /robot/fmu/in/lamp, type: 'px4_msgs::msg::Lamp'}
"""
BRIDGED = {**lamps(0, 1, current=3), "dds_topics.yaml": BRIDGE}


@pytest.fixture(scope="module")
def topics(tmp_path_factory: pytest.TempPathFactory) -> Any:
    package = package_of(BRIDGED, tmp_path_factory.mktemp("bridged"))
    return importlib.import_module(f"{package.__name__}.topics")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("/fmu/out/lamp", "LampV0"),
        ("/fmu/out/lamp_v1", "LampV1"),
        ("/fmu/out/lamp_v3", "Lamp"),
        ("/fmu/in/lamp", "LampV0"),
        ("/fmu/in/lamp_v3", "Lamp"),
        ("/fmu/out/lamp1_v1", "LampV1"),
        ("/robot/fmu/in/lamp_v1", "LampV1"),
        ("/uav_1/fmu/out/lamp", "LampV0"),
        ("/uav_1/fmu/out/lamp_v3", "Lamp"),
        ("/fleet/uav_1/fmu/in/lamp_v1", "LampV1"),
        ("/fleet/robot/fmu/in/lamp_v1", "LampV1"),
        ("/fmu/out/fan", "Fan"),
        ("/uav_1/fmu/out/fan", "Fan"),
    ],
)
def test_the_name_of_a_topic_leads_to_the_type_of_its_version(name: str, message: str, topics: Any) -> None:
    """ROS 2 and DDS names both work; direction, instance and all other attributes are those of the endpoint."""
    for spelling in (name, f"rt{name}"):
        endpoint = topics.endpoint(spelling)
        assert (endpoint.ros_name, endpoint.dds_name) == (name, f"rt{name}")
        assert endpoint.message.__name__ == endpoint.message_name == message
        assert endpoint.direction == ("out" if "/out/" in name else "in")
        assert endpoint.instance == (1 if "lamp1" in name else None)


def test_where_a_topic_has_a_name_of_its_own_no_namespace_is_looked_for(topics: Any) -> None:
    assert topics.endpoint("/robot/fmu/in/lamp").object_id == topics.ENDPOINTS[-1].object_id
    assert topics.endpoint("/other/fmu/in/lamp").object_id == topics.ENDPOINTS[-2].object_id


def test_a_topic_that_is_called_like_a_version_of_another_is_itself(tmp_path: Path) -> None:
    files = {**BRIDGED, "msg/Fan.msg": f"# TOPICS lamp_v1\n{STAMP}"}
    row = "  - {topic: /fmu/out/lamp_v1, type: 'px4_msgs::msg::Fan'}\n"
    without = BRIDGE.replace("  - {topic: /fmu/out/fan, type: 'px4_msgs::msg::Fan'}\n", "")
    files["dds_topics.yaml"] = without.replace("publications:\n", f"publications:\n{row}")
    package = package_of(files, tmp_path)
    topics = importlib.import_module(f"{package.__name__}.topics")
    for name in ("/fmu/out/lamp_v1", "/uav_1/fmu/out/lamp_v1"):
        assert topics.endpoint(name).message is package.Fan
    assert topics.endpoint("/uav_1/fmu/out/lamp").message is package.LampV0


def test_the_current_version_is_the_row_of_the_table(topics: Any) -> None:
    for endpoint in topics.ENDPOINTS:
        assert topics.endpoint(endpoint.ros_name) is endpoint
        assert topics.versions_of(endpoint.dds_name)[-1] == endpoint


@pytest.mark.parametrize("name", ["/fmu/out/lamp", "/fmu/out/lamp_v1", "rt/fmu/out/lamp_v3", "/fmu/out/lamp_v9"])
def test_all_versions_of_a_topic_are_listed_by_any_of_its_names(name: str, topics: Any) -> None:
    found = topics.versions_of(name)
    assert [(endpoint.ros_name, endpoint.message_name) for endpoint in found] == [
        ("/fmu/out/lamp", "LampV0"),
        ("/fmu/out/lamp_v1", "LampV1"),
        ("/fmu/out/lamp_v3", "Lamp"),
    ]
    assert {(endpoint.object_id, endpoint.rate_limit_hz, endpoint.qos) for endpoint in found} == {
        (endpoint.object_id, endpoint.rate_limit_hz, endpoint.qos) for endpoint in topics.ENDPOINTS[:1]
    }


def test_versions_are_listed_in_the_namespace_that_was_asked_for(topics: Any) -> None:
    names = [endpoint.ros_name for endpoint in topics.versions_of("/uav_1/fmu/in/lamp")]
    assert names == ["/uav_1/fmu/in/lamp", "/uav_1/fmu/in/lamp_v1", "/uav_1/fmu/in/lamp_v3"]
    assert [endpoint.ros_name for endpoint in topics.versions_of("/uav_1/fmu/out/fan")] == ["/uav_1/fmu/out/fan"]


def test_namespaced_has_the_current_versions(topics: Any) -> None:
    found = topics.namespaced("uav_1")
    assert [endpoint.ros_name for endpoint in found] == [f"/uav_1{endpoint.ros_name}" for endpoint in topics.ENDPOINTS]
    assert all(topics.endpoint(endpoint.ros_name) == endpoint for endpoint in found)


def only(*names: str) -> str:
    """Return the end of an error about a version without a type."""
    quoted = ", ".join(f"'{name}'" for name in names)
    own = ", the last one for its own firmware" if len(names) > 1 else ""
    text = f": the suffix is the version of the message, and this package has only {quoted}{own}"
    return f"{text}; another version needs a package of its release"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("/fmu/out/lamp_v2", only("/fmu/out/lamp", "/fmu/out/lamp_v1", "/fmu/out/lamp_v3")),
        ("rt/uav/fmu/in/lamp_v9", only("rt/uav/fmu/in/lamp", "rt/uav/fmu/in/lamp_v1", "rt/uav/fmu/in/lamp_v3")),
        ("/fmu/out/fan_v1", only("/fmu/out/fan")),
        ("/fmu/out/lamp_v0", only("/fmu/out/lamp", "/fmu/out/lamp_v1", "/fmu/out/lamp_v3")),
        ("/fmu/out/lump_v1", ", did you mean '/fmu/out/lamp_v1'?"),
        ("fmu/out/lamp", ", did you mean '/fmu/out/lamp'?"),
        ("/1uav/fmu/out/lamp", ", did you mean '/fmu/out/lamp'?"),
        ("zzzzzz", ""),
        ("", ""),
    ],
)
def test_a_version_that_there_is_no_type_of_is_answered_with_those_that_there_are(
    name: str, said: str, topics: Any
) -> None:
    with pytest.raises(KeyError) as caught:
        topics.endpoint(name)
    assert str(caught.value) == f"no endpoint '{name}'{said}"


@pytest.mark.parametrize("name", ["/fmu/out/lump", "zzzzzz"])
def test_a_topic_that_there_is_not_has_no_versions(name: str, topics: Any) -> None:
    with pytest.raises(KeyError, match=f"no endpoint '{name}'"):
        topics.versions_of(name)


@pytest.mark.parametrize("release", ["v1.14", "v1.15"])
def test_without_versions_in_names_a_name_leads_to_the_current_type(release: str, tmp_path: Path) -> None:
    """These releases have the conventions before v1.16; the types of archived versions exist all the same."""
    files = {
        name: text.replace("instance: 1", "rate_limit: 1").replace(
            "out/lamp, type: 'px4_msgs::msg::Lamp', rate_limit: 1", "out/fan2, type: 'px4_msgs::msg::Fan'"
        )
        for name, text in BRIDGED.items()
    }
    files["msg/Fan.msg"] = f"# TOPICS fan fan2\n{STAMP}"
    catalog = catalog_with_archived(write_definitions(tmp_path / "in", files), release)
    package = import_package(catalog, tmp_path / "out")
    topics = importlib.import_module(f"{package.__name__}.topics")
    assert topics.endpoint("/fmu/out/lamp").message is package.Lamp
    assert [endpoint.message for endpoint in topics.versions_of("/fmu/out/lamp")] == [package.Lamp]
    with pytest.raises(KeyError, match="this package has only '/fmu/out/lamp'; another version needs"):
        topics.endpoint("/fmu/out/lamp_v1")
    assert type(package.LampV0().upgrade().message) is package.LampV1


def test_archived_versions_are_no_topics_of_uorb(topics: Any) -> None:
    assert set(topics.UORB) == {"lamp", "fan"}
    assert [topic.name for topic in topics.ORB_ID] == ["fan", "lamp"]
    assert topics.UORB["lamp"].message.__name__ == "Lamp"


# --- Command


Capture = pytest.CaptureFixture[str]
OWN_FOLDER = pytest.mark.usefixtures("working_folder")
LAMP_V0 = Path("in", ARCHIVE, "LampV0.msg")
TYPES_OF = Path("generated", "px4_types")


def build(*arguments: str) -> int:
    return main(["build", "--px4", "in", *arguments])


@OWN_FOLDER
def test_archived_versions_come_on_request(capsys: Capture) -> None:
    write_definitions(Path("in"), BRIDGED)
    assert build() == DONE
    assert not (TYPES_OF / "msg" / "_lamp_v0.py").exists()
    assert build("--archived") == DONE
    assert "2 messages, 2 archived versions, 0 services" in capsys.readouterr().out
    assert {"_lamp.py", "_lamp_v0.py", "_lamp_v1.py"} < set(os.listdir(TYPES_OF / "msg"))
    assert build("--archived", "--check") == DONE
    assert build("--check") == FINDINGS
    assert build("--no-archived") == DONE
    assert not (TYPES_OF / "msg" / "_lamp_v0.py").exists()
    assert not (TYPES_OF / "versions.py").exists()


@pytest.mark.slow
@OWN_FOLDER
def test_the_page_shows_what_really_happens(capsys: Capture) -> None:
    copied("firmware/main-2026-03", Path("PX4-Autopilot"))
    write_definitions(Path("PX4-Autopilot"), headers_of_vehicle_status(Path("PX4-Autopilot")))
    command, summary, written, _ = between(PAGE, "console").splitlines()
    assert main(command.removeprefix("$ msggen ").split()) == DONE
    printed = capsys.readouterr().out.splitlines()
    assert [printed[0], re.sub("in .* s$", "", printed[1])] == [summary, re.sub("in .* s$", "", written)]
    program = f"{between(PAGE, 'python')}\n{PROGRAM}"
    examples = f"import doctest\nprint(doctest.run_docstring_examples({between(PAGE, 'pycon')!r}, {{}}))\n"
    described = "import inspect, px4_types\nprint(inspect.getdoc(px4_types.VehicleStatusV1.upgrade))"
    docstring = textwrap.dedent(between(PAGE, "text").partition("\n")[2])
    for source, expected in ((program, "7 21\n7 21\n"), (examples, "None\n"), (described, docstring)):
        done = subprocess.run([sys.executable, "-c", source], cwd="src", capture_output=True, text=True, check=True)
        assert done.stdout == expected


def headers_of_vehicle_status(tree: Path) -> dict[str, str]:
    """Return the part of PX4's translations that the page needs."""
    catalog = catalog_with_archived(tree)
    older, newer = catalog.versions(catalog.messages["px4_msgs/VehicleStatus"])[-2:]
    both = {field.name for field in older.fields} & {field.name for field in newer.fields}
    copied = " ".join(f"n.{name} = o.{name};" for name in sorted(both))
    statements = f"{copied} n.nav_state_display = o.nav_state; n.traffic_avoidance_system_present = false;"
    return {
        f"{TRANSLATIONS}/all_translations.h": '#include "status.h"\n',
        f"{TRANSLATIONS}/status.h": class_of("VehicleStatus", statements, older="px4_msgs_old::msg::VehicleStatusV1"),
    }


PROGRAM = """
from px4_types import VehicleStatusV0
sent = {"uav_1/fmu/out/vehicle_status": VehicleStatusV0, "uav_2/fmu/out/vehicle_status_v2": VehicleStatus}
for topic, version in sent.items():
    status = receive(f"rt/{topic}", version(system_id=7, nav_state=21).encode())
    assert type(status) is VehicleStatus
    print(status.system_id, status.nav_state)
"""
"""Two vehicles for the program on the page."""


def between(page: str, language: str) -> str:
    """Return the first code block of a language."""
    return page.split(f"```{language}\n")[1].partition("```")[0]


@OWN_FOLDER
def test_archived_definitions_are_inputs_and_their_types_outputs(capsys: Capture) -> None:
    write_definitions(Path("in"), BRIDGED)
    build("--archived", "--depfile", "types.d")
    assert str(LAMP_V0) in Path("types.d").read_text()
    capsys.readouterr()
    for _ in range(2):
        assert build("--archived", "--list-outputs") == DONE
        listed = capsys.readouterr().out.split()
        made = [path for path in TYPES_OF.rglob("*") if path.suffix in (".py", ".typed") or path.name == "names.json"]
        assert sorted(listed) == sorted(map(str, made))
        (TYPES_OF / ".msggen.json").unlink(missing_ok=True)  # this makes the next run read the definitions


@OWN_FOLDER
def test_a_build_is_stale_when_an_archived_definition_changes() -> None:
    write_definitions(Path("in"), BRIDGED)
    build("-q", "--archived")
    assert build("-q", "--archived", "--check") == DONE
    LAMP_V0.write_text(LAMP_V0.read_text() + "uint8 more\n")
    assert build("-q", "--archived", "--check") == FINDINGS
    LAMP_V0.unlink()
    assert build("-q", "--archived") == DONE
    assert not (TYPES_OF / "msg" / "_lamp_v0.py").exists()


@OWN_FOLDER
def test_a_build_with_nothing_to_do_imports_nothing_heavy() -> None:
    write_definitions(Path("in"), BRIDGED)
    assert build("-q", "--archived") == DONE
    program = (
        "import sys; from msggen.cli import main; main(['build', '--px4', 'in', '--archived']); print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert "is up to date" in done.stdout
    assert not HEAVY & {*done.stdout.split()}


@OWN_FOLDER
@pytest.mark.parametrize(
    ("setting", "option", "expected"),
    [
        ("true", (), "yes"),
        ("false", (), "no"),
        ("true", ("--no-archived",), "no"),
        ("false", ("--archived",), "yes"),
    ],
)
def test_the_setting_asks_for_them_too_and_the_command_line_wins(
    setting: str, option: tuple[str, ...], expected: str
) -> None:
    write_definitions(Path("in"), {**BRIDGED})
    write_definitions(Path(), {"pyproject.toml": f"[tool.msggen]\npx4 = 'in'\narchived = {setting}\n"})
    assert main(["build", "-q", *option]) == DONE
    assert (TYPES_OF / "versions.py").exists() == (expected == "yes")


@OWN_FOLDER
def test_other_commands_leave_archived_versions_out_whatever_the_setting() -> None:
    write_definitions(Path("in"), {**BRIDGED, "pyproject.toml": ""})
    write_definitions(Path(), {"pyproject.toml": "[tool.msggen]\npx4 = 'in'\narchived = true\n"})
    assert main(["sync", "-q", "--create", "out"]) == DONE
    assert sorted(os.listdir("out/msg")) == ["Fan.msg", "Lamp.msg"]
    assert main(["check", "out"]) == DONE


@OWN_FOLDER
@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("LampV1", f"{version(0)}{STAMP}", ":1:1: M404 MESSAGE_VERSION must be 1, as in the name, found 0"),
        ("LampV1", STAMP, ":1:1: M404 MESSAGE_VERSION must be 1, as in the name, found 0"),
        ("LampV0", f"{STAMP}{version(2)}", ":2:1: M404 MESSAGE_VERSION must be 0, as in the name, found 2"),
        (
            "Lamp1",
            STAMP,
            ":1:1: M201 file name 'Lamp1': expected the name of an archived version, such as 'VehicleStatusV1'",
        ),
        (
            "LampV01",
            version(1),
            ":1:1: M201 file name 'LampV01': expected the name of an archived version, such as 'VehicleStatusV1'",
        ),
        (
            "LampV0",
            f"{STAMP}Fan fan\n",
            ":2:1: M301 unknown type 'Fan': archived messages nest archived ones, such as 'FanV0'",
        ),
        ("LampV0", f"{STAMP}LumpV2 x\n", ":2:1: M301 unknown type 'LumpV2', did you mean 'LumPV1'?"),
        ("LampV0", f"{STAMP}LampV0 x\n", ":2:1: M302 messages nest each other: LampV0 > LampV0"),
        ("LampV0", f"{STAMP}uint8 1a\n", ":2:7: M201 field name '1a': expected lower_case"),
        (
            "Lump_V1",
            version(1),
            ":1:1: M201 file name 'Lump_V1': expected the name of an archived version, such as 'VehicleStatusV1'",
        ),
    ],
)
def test_an_error_in_an_archived_definition_has_its_place(name: str, text: str, said: str, capsys: Capture) -> None:
    others = {"msg/Fan.msg": STAMP, f"{ARCHIVE}/LumPV1.msg": version(1) + STAMP}
    write_definitions(Path("in"), {**others, f"{ARCHIVE}/{name}.msg": text})
    assert build("--archived") == FAILED
    errors = capsys.readouterr().err.splitlines()
    assert any(error.startswith(f"in/{ARCHIVE}/{name}.msg{said}") for error in errors), errors
    assert errors[-1] == "1 error, nothing written"
    assert build("-q") == DONE, "who does not ask for archived versions does not read them"


@OWN_FOLDER
def test_a_current_message_named_like_an_archived_one_is_refused(capsys: Capture) -> None:
    write_definitions(Path("in"), {**lamps(0, current=1), "msg/LampV0.msg": STAMP})
    assert build("--archived") == FAILED
    assert "M204 'LampV0' is already defined in in/msg/LampV0.msg" in capsys.readouterr().err


@OWN_FOLDER
def test_what_only_uorb_asks_for_is_not_asked_of_archived_versions() -> None:
    """The rules concern the timestamp, the spelling of topic names, and topics of other messages."""
    text = f"{version(0)}# TOPICS lamp  lamp2\n# TOPICS fan\nuint8 x\n"
    write_definitions(Path("in"), {**lamps(current=1), f"{ARCHIVE}/LampV0.msg": text})
    assert build("-q", "--archived") == DONE


@OWN_FOLDER
@pytest.mark.parametrize(
    "arguments", [("--px4", "in"), ("--msg-dir", "in/msg"), ("--px4", "v1.15")], ids=["tree", "folder", "embedded"]
)
def test_sources_without_archived_versions_are_refused(arguments: tuple[str, ...], capsys: Capture) -> None:
    write_definitions(Path("in"), {"msg/Fan.msg": STAMP, "src/modules/x": ""})
    assert main(["build", "--archived", *arguments]) == FAILED
    label = arguments[-1].replace("v1.15", "the embedded PX4 v1.15")
    first, last = capsys.readouterr().err.splitlines()
    said = f"{label} has no archived versions: PX4 v1.16 and later have them in {ARCHIVE}"
    assert first == f"--archived: S117 {said}"
    assert last == "1 error, nothing written"


@OWN_FOLDER
@pytest.mark.parametrize(
    "arguments", [("--px4", "in"), ("--px4", "in.tar"), ("--msg-dir", "in"), ("--msg-dir", "in/msg")]
)
def test_every_kind_of_source_gives_its_archived_versions(arguments: tuple[str, str]) -> None:
    import tarfile

    write_definitions(Path("in"), lamps(0, current=1))
    with tarfile.open("in.tar", "w") as packed:
        packed.add("in")
    assert main(["build", "-q", "--archived", *arguments]) == DONE
    assert (TYPES_OF / "msg" / "_lamp_v0.py").exists()


# --- Types


APPLICATION = """
from lamps import Lamp, LampV0, LampV1, topics
from lamps.cdr import Message
from lamps.versions import Converted, convert

old: LampV0 = LampV0(timestamp=1)
middle: LampV1 = old.upgrade().message
new: Lamp = middle.upgrade().message
back: LampV1 = new.downgrade().message
step: Converted[LampV1] = old.upgrade()
whole: Converted[Lamp] = convert(topics.endpoint("/fmu/out/lamp").message.decode(b""), Lamp)
some: Converted[Message] = whole
lost: tuple[str, ...] = step.dropped + step.defaulted
for endpoint in topics.versions_of("/fmu/out/lamp"):
    message: Message = endpoint.message.decode(b"")
match step:
    case Converted(message=carried):
        number: int = carried.timestamp
"""
MISTAKES = """
from lamps import Lamp, LampV0
from lamps.versions import convert

Lamp().upgrade()
LampV0().downgrade()
x: Lamp = LampV0().upgrade().message
y: LampV0 = convert(LampV0(), Lamp).message
LampV0().upgrade().dropped = 5
"""


@pytest.fixture(scope="module")
def typed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package `lamps`, nested messages in it, and programs that use it."""
    folder = tmp_path_factory.mktemp("typed")
    catalog = catalog_with_archived(write_definitions(folder / "in", {**NESTED, **BRIDGED}))
    for path, text in render_package(catalog, "lamps").items():
        write_definitions(folder / "lamps", {path: text})
    return write_definitions(folder, {"application.py": APPLICATION, "mistakes.py": MISTAKES})


def checked(folder: Path, *command: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.night  # each run finds the mistakes, and nothing else
def test_mypy_is_content_with_a_package_of_versions(typed: Path) -> None:
    done = mypy(typed, "lamps", "application.py")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_the_types_of_versions_catch_mistakes(typed: Path) -> None:
    lines = mypy(typed, "mistakes.py").stdout.splitlines()
    assert {int(line.split(":")[1]) for line in lines if "error:" in line} == {5, 6, 7, 8, 9}


@pytest.mark.night  # each run checks the modules of versions, in tests/definitions/test_translations.py
def test_pyright_is_content_with_a_package_of_versions(typed: Path, tmp_path: Path) -> None:
    include = [str(typed / "lamps"), str(typed / "application.py")]
    configuration = {
        "include": include,
        "extraPaths": [str(typed)],
        "typeCheckingMode": "strict",
        "pythonVersion": "3.10",
    }
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(configuration))
    code, output = checked(
        tmp_path, "basedpyright", "--level", "error", "--pythonpath", sys.executable, "-p", str(tmp_path)
    )
    assert code == 0, output


def test_ruff_is_content_with_a_package_of_versions(typed: Path) -> None:
    rules = ("--select=E,F,W,B,C4,PLE,SIM,UP", "--ignore=B905,UP007", "--line-length=130")
    code, output = checked(typed, "ruff", "check", "--isolated", "--target-version=py310", *rules, "lamps")
    assert code == 0, output
