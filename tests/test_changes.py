"""Changes that are easily taken for others: what each of them is, and whether old readers notice."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest
from conftest import write_definitions

from msggen.check import breaking
from msggen.compare.finding import Rule
from msggen.compare.rules import BREAKING, named
from msggen.firmware.source import find_sources

T = "uint64 timestamp\n"
TRANSLATIONS = "msg/translation_node/translations"
BRIDGE = "src/modules/uxrce_dds_client/dds_topics.yaml"


def bridged(topic: str, type_: str) -> str:
    return f"publications:\n- topic: {topic}\n  type: px4_msgs::msg::{type_}\n"


class Case(NamedTuple):
    """Files before and after, what is found as (rule, subject), and the subjects that go wrong silently."""

    previous: dict[str, str]
    current: dict[str, str]
    found: set[tuple[str, str]]
    silent: tuple[str, ...] = ()


INNER = {"msg/Inner.msg": f"{T}float32 x\nfloat32 y\n"}
SWAPPED = {"msg/Inner.msg": f"{T}float32 y\nfloat32 x\n"}
OUTER = {"msg/Middle.msg": f"{T}Inner[2] i\n", "msg/Outer.msg": f"{T}Middle m\nuint8 a\n"}
HOME = "uint64 timestamp\nuint8 A = 1\n"
NOT_YET = f"// px4_msgs_old::msg::WV0 and px4_msgs::msg::W {T}"

CASES = {
    "what is nested trades places, at every depth": Case(
        {**INNER, **OUTER},
        {**SWAPPED, **OUTER},
        {("FIELD_MOVED", "Inner"), ("NESTED_LAYOUT_CHANGED", "Middle"), ("NESTED_LAYOUT_CHANGED", "Outer")},
        ("Inner", "Middle", "Outer"),
    ),
    "what is nested is only renamed, at every depth": Case(
        {**INNER, **OUTER},
        {"msg/Inner.msg": f"{T}float32 x\nfloat32 z\n", **OUTER},
        {("FIELD_RENAMED", "Inner"), ("NESTED_NAME_CHANGED", "Middle"), ("NESTED_NAME_CHANGED", "Outer")},
    ),
    "another nested type with the same fields": Case(
        {**INNER, "msg/Other.msg": INNER["msg/Inner.msg"], "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": INNER["msg/Inner.msg"], "msg/Outer.msg": f"{T}Other i\n"},
        {("TYPE_RENAMED", "Outer")},
    ),
    "another nested type with its fields in another order": Case(
        {**INNER, "msg/Other.msg": SWAPPED["msg/Inner.msg"], "msg/Outer.msg": f"{T}Inner i\n"},
        {**INNER, "msg/Other.msg": SWAPPED["msg/Inner.msg"], "msg/Outer.msg": f"{T}Other i\n"},
        {("FIELD_RETYPED", "Outer")},
        ("Outer",),
    ),
    "char and byte are other names for uint8": Case(
        {"msg/A.msg": f"{T}uint8[4] name\nbyte b\n"},
        {"msg/A.msg": f"{T}char[4] name\nuint8 b\n"},
        {("TYPE_RENAMED", "A")},
    ),
    "bool is not": Case(
        {"msg/A.msg": f"{T}uint8 a\n"}, {"msg/A.msg": f"{T}bool a\n"}, {("FIELD_RETYPED", "A")}, ("A",)
    ),
    "a length and what is nested": Case(
        {**INNER, "msg/Outer.msg": f"{T}Inner[2] i\n"},
        {"msg/Inner.msg": f"{T}float32 x\nfloat64 y\n", "msg/Outer.msg": f"{T}Inner[3] i\n"},
        {("FIELD_RETYPED", "Inner"), ("ARRAY_LENGTH_CHANGED", "Outer"), ("NESTED_LAYOUT_CHANGED", "Outer")},
    ),
    "a new field in the padding at the end": Case(
        {"msg/A.msg": f"{T}uint8 a\n"}, {"msg/A.msg": f"{T}uint8 a\nuint8 b\n"}, {("FIELD_ADDED", "A")}
    ),
    "a new field in front, in what was padding": Case(
        {"msg/A.msg": f"{T}uint8 a\nuint8 b\n"},
        {"msg/A.msg": f"{T}uint8 new\nuint8 a\nuint8 b\n"},
        {("FIELD_ADDED", "A")},
        ("A",),
    ),
    "a field renamed and given another unit": Case(
        {"msg/A.msg": f"{T}float32 alt  # [m]\n"},
        {"msg/A.msg": f"{T}float32 alt_cm  # [cm]\n"},
        {("FIELD_RENAMED", "A"), ("UNIT_CHANGED", "A")},
    ),
    "the same constants spelled otherwise": Case(
        {"msg/A.msg": f"{T}uint8 A = 0x10\nfloat32 B = 0.1\nfloat32 C = nan\nbool D = true\nint8 E = -1\n"},
        {"msg/A.msg": f"{T}uint8 A = 16\nfloat32 B = 0.10000000149011612\nfloat32 C = NaN\nbool D = 1\nint8 E=-1\n"},
        set(),
    ),
    "the same invalid value in other words": Case(
        {"msg/A.msg": f"{T}float32 a  # [@invalid NaN if unknown]\nfloat32 b  # [@invalid 0 never]\n"},
        {"msg/A.msg": f"{T}float32 a  # [@invalid nan]\nfloat32 b  # [@invalid 0.0]\n"},
        set(),
    ),
    "another invalid value that begins with the same word": Case(
        {"msg/A.msg": f"{T}float32 a  # [@invalid negative values]\n"},
        {"msg/A.msg": f"{T}float32 a  # [@invalid negative infinity]\n"},
        {("INVALID_CHANGED", "A")},
    ),
    "a version that jumps with nothing but a constant": Case(
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 0\n{HOME}"},
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 5\n{HOME}uint8 B = 2\n"},
        {("VERSION_NOT_RAISED", "W")},
    ),
    "a version that goes back with nothing but a constant": Case(
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 3\n{HOME}"},
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 1\n{HOME}uint8 B = 2\n"},
        {("VERSION_NOT_RAISED", "W")},
    ),
    "a header that only talks of translating": Case(
        {"msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 0\n{T}uint8 a\n"},
        {
            "msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}uint16 a\n",
            "msg/px4_msgs_old/msg/WV0.msg": f"uint32 MESSAGE_VERSION = 0\n{T}uint8 a\n",
            f"{TRANSLATIONS}/all_translations.h": '#include "w.h"\n',
            f"{TRANSLATIONS}/w.h": NOT_YET,
        },
        {("FIELD_RETYPED", "W"), ("TRANSLATION_MISSING", "W")},
        ("W",),
    ),
    "a bridge that is gone from a tree of the firmware": Case(
        {"msg/Rpm.msg": T, BRIDGE: bridged("/fmu/out/rpm", "Rpm")},
        {"msg/Rpm.msg": T, "src/modules/uxrce_dds_client/module.yaml": ""},
        {("TOPIC_REMOVED", "/fmu/out/rpm")},
    ),
    "a topic that moves and carries another message": Case(
        {"msg/A.msg": f"# TOPICS a t\n{T}", "msg/B.msg": T, BRIDGE: bridged("/fmu/out/t", "A")},
        {"msg/A.msg": T, "msg/B.msg": f"# TOPICS b t\n{T}", BRIDGE: bridged("/fmu/out/sub/t", "B")},
        {("TOPIC_MOVED", "/fmu/out/sub/t"), ("TOPIC_RETYPED", "/fmu/out/sub/t")},
    ),
    "archived versions that a package never has": Case(
        {
            "msg/versioned/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}",
            "msg/px4_msgs_old/msg/WV0.msg": f"uint32 MESSAGE_VERSION = 0\n{T}",
        },
        {"msg/W.msg": f"uint32 MESSAGE_VERSION = 1\n{T}"},
        set(),
    ),
}


def run(folder: Path, case: Case, ignored: dict[str, tuple[Rule, ...]] | None = None) -> list[tuple[str, str, bool]]:
    sides = [write_definitions(folder / name, getattr(case, name)) for name in ("previous", "current")]
    before, after = (find_sources(str(side)) for side in sides)
    findings = breaking(before, after, BREAKING, ignored).findings
    return [(each.rule.id, each.change.subject, each.is_silent) for each in findings]


@pytest.mark.parametrize("name", CASES)
def test_a_change_is_what_it_is_and_nothing_else(name: str, tmp_path: Path) -> None:
    found = run(tmp_path, CASES[name])
    assert {(rule, subject) for rule, subject, _ in found} == CASES[name].found
    assert sorted({subject for _, subject, is_silent in found if is_silent}) == sorted(CASES[name].silent)


@pytest.mark.parametrize("pattern", ["SetRpm", "Set*", "SetRpm_Request"])
def test_a_service_is_ignored_by_its_name(pattern: str, tmp_path: Path) -> None:
    case = Case({"srv/SetRpm.srv": "float32 a\n---\nbool b\n"}, {"srv/SetRpm.srv": "float64 a\n---\nbool b\n"}, set())
    assert run(tmp_path, case) == [("FIELD_RETYPED", "SetRpm_Request", False)]
    assert run(tmp_path, case, {pattern: named("WIRE")}) == []


@pytest.mark.parametrize("name", CASES)
def test_every_finding_is_at_a_place_that_exists(name: str, tmp_path: Path) -> None:
    run(tmp_path, CASES[name])
    before, after = (find_sources(str(tmp_path / side)) for side in ("previous", "current"))
    named_otherwise = after._replace(label="the working tree")
    assert [
        each for each in breaking(before, named_otherwise).findings if not Path(each.change.location.path).exists()
    ] == []
