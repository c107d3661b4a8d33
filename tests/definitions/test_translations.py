"""Tests of the firmware's translation headers: the parsed rules, and the results of upgrade() and downgrade().

The headers are written for these tests, one for every form; the firmware's own headers are checked by hand.
"""

from __future__ import annotations

import ast
import importlib
import json
import math
import subprocess
import sys
import tarfile
import time
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msggen.cli import DONE, FINDINGS, main
from msggen.definitions.model import Catalog
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.translation import read_classes, read_headers, read_translations
from msggen.definitions.translation import Assignment, Number, Place, Step
from msggen.generate.python.package import list_package, render_package
from msggen.generate.python.versions import translation_table
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from msggen.sources.translation_check import Version, lost_values
from support.catalogs import import_package, write_definitions
from support.checkers import mypy
from support.examples import by_day, examples
from support.samples import plain
from support.translations import HEADERS, class_of

ARCHIVE = "msg/px4_msgs_old/msg"
NAN, INF = math.nan, math.inf
LOST = object()


def tree(versions: dict[str, tuple[str, str]], header: str, **others: str) -> dict[str, str]:
    """Return a tree with two versions of each message, and one header."""
    files = {
        f"{HEADERS}/all_translations.h": '#pragma once\n#include <translation_util.h>\n#include "translations.h"\n',
        f"{HEADERS}/translations.h": f"#pragma once\n{header}",
        **others,
    }
    for name, (older, newer) in versions.items():
        files[f"{ARCHIVE}/{name}V0.msg"] = f"uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n{older}"
        files[f"msg/versioned/{name}.msg"] = f"uint32 MESSAGE_VERSION = 1\nuint64 timestamp\n{newer}"
    return files


def catalog_of(folder: Path, files: dict[str, str]) -> Catalog:
    return read_catalog(with_archived(find_sources(str(write_definitions(folder, files)))))


def package_of(files: dict[str, str], folder: Path) -> Any:
    return import_package(catalog_of(folder / "in", files), folder / "out")


# --- Single statements


YES, NO = True, False


class Form(NamedTuple):
    """A statement that sets `y` of type `newer` from `x` of type `older`, and the result for a value of `x`."""

    older: str
    newer: str
    statement: str
    value: Any
    expected: Any


FORMS = [
    # a different field
    Form("uint8", "uint8", "n.y = o.x;", 7, 7),
    Form("uint8", "uint8", "n.y=o.x ; // n.y = 5;", 7, 7),
    Form("uint8", "uint8", "/* n.y = 5; */ n.y = (o.x);", 7, 7),
    Form("uint16", "uint8", "n.y = o.x;", 255, 255),
    Form("uint16", "uint8", "n.y = o.x;", 256, LOST),
    Form("uint8", "float32", "n.y = o.x;", 7, LOST),
    Form("float64", "float32", "n.y = o.x;", 0.1, LOST),
    Form("string", "string", "n.y = o.x;", "a", "a"),
    Form("uint8[3]", "uint8[3]", "n.y = o.x;", b"abc", b"abc"),
    Form("float32[3]", "float32", "n.y = o.x[1];", (1.0, 2.0, 3.0), 2.0),
    Form("float32", "float32[2]", "n.y[1] = o.x; n.y.at(0) = o.x;", 4.0, (4.0, 4.0)),
    # constants
    Form("uint8", "float32", "n.y = NAN;", 0, NAN),
    Form("uint8", "float32", "n.y = std::numeric_limits<float>::quiet_NaN();", 0, NAN),
    Form("uint8", "float32", 'n.y = std::nanf("");', 0, NAN),
    Form("uint8", "float64", "n.y = -INFINITY;", 0, -INF),
    Form("uint8", "float32", "n.y = -.5e1f;", 0, -5.0),
    Form("uint8", "float32", "n.y = 1;", 0, 1.0),
    Form("uint8", "float32", "n.y = 0.1;", 0, 0.10000000149011612),
    Form("uint8", "float64", "n.y = 0.1;", 0, 0.1),
    Form("uint8", "float64", "n.y = 0.1f;", 0, 0.10000000149011612),
    Form("uint8", "float32", "n.y = 1e39;", 0, LOST),
    Form("uint8", "uint32", "n.y = 0xffffffff;", 0, 2**32 - 1),
    Form("uint8", "uint32", "n.y = 1'000u;", 0, 1000),
    Form("uint8", "uint8", "n.y = 010;", 0, 8),
    Form("uint8", "uint8", "n.y = 0b11;", 0, 3),
    Form("uint8", "uint8", "n.y = UINT8_MAX;", 0, 255),
    Form("uint8", "uint8", "n.y = 256;", 0, LOST),
    Form("uint8", "uint8", "n.y = -1;", 0, LOST),
    Form("uint8", "int8", "n.y = -1;", 0, -1),
    Form("uint8", "int8", "n.y = 3.0f;", 0, 3),
    Form("uint8", "int8", "n.y = 3.5f;", 0, LOST),
    Form("uint8", "bool", "n.y = true;", 0, YES),
    Form("uint8", "bool", "n.y = 1;", 0, YES),
    Form("uint8", "bool", "n.y = 2;", 0, LOST),
    Form("uint8", "uint8", "n.y = MessageNewer::ONE;", 0, 1),
    Form("uint8", "uint8", "n.y = o.TWO;", 0, 2),
    Form("uint8", "uint8", "n.y = n.THREE;", 0, LOST),
    Form("uint8", "uint8[2]", "n.y = {};", 0, b"\0\0"),
    Form("uint8", "float32", "n.y = decltype(n.y)();", 0, 0.0),
    # conditions
    Form("float32", "float32", "n.y = std::isnan(o.x) ? 0.0f : o.x;", NAN, 0.0),
    Form("float32", "float32", "n.y = std::isnan(o.x) ? 0.0f : o.x;", 2.5, 2.5),
    Form("float32", "bool", "n.y = !isfinite(o.x);", INF, YES),
    Form("float32", "bool", "n.y = std::isinf(o.x) || o.x > -1.5f;", -1.0, YES),
    Form("uint8", "bool", "n.y = o.x > 0 && o.x <= 3;", 3, YES),
    Form("uint8", "bool", "n.y = (o.x == 1 || o.x == 2) && !(o.x > 1);", 2, NO),
    Form("uint8", "uint8", "n.y = o.x < 5 ? o.x : o.x < 9 ? 5 : MessageNewer::ONE;", 9, 1),
    Form("uint8", "uint8", "if (o.x > o.TWO) { n.y = n.ONE; } else { n.y = o.x; }", 3, 1),
    Form("uint8", "uint8", "if (o.x > 2) n.y = 4; else if (o.x == 2) n.y = 5; else n.y = o.x;", 2, 5),
    Form("uint8", "uint8", "n.y = o.x; if (o.x > 2) { n.y = 9; }", 3, 9),
    Form("uint8", "uint8", "if (o.x > 2) { n.y = 9; }", 3, LOST),
    Form("uint8", "bool", "n.y = o.x;", 1, LOST),
    Form("uint8", "bool", "n.y = o.x && true;", 1, LOST),
    Form("uint32", "bool", "n.y = o.x > -1;", 1, LOST),
    Form("int32", "bool", "n.y = o.x > -1;", 1, YES),
    Form("float32", "bool", "n.y = o.x == true;", 1.0, LOST),
    # loops
    Form(
        "float32[3]", "float32[3]", "for (int i = 0; i < 3; ++i) { n.y[i] = o.x[i]; }", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)
    ),
    Form("uint8[3]", "int16[3]", "for (size_t i = 0; i < n.y.size(); i++) n.y[i] = o.x.at(i);", b"abc", (97, 98, 99)),
    Form("uint8[2]", "uint8[3]", "for (int i = 0; i < 2; ++i) n.y[i] = o.x[i]; n.y[2] = 9;", b"ab", b"ab\t"),
    Form(
        "float32[2]",
        "float32[3]",
        "for (std::size_t i = 0; i < std::min(o.x.size(), n.y.size()); ++i) { n.y[i] = o.x[i]; }"
        "for (int k = 2; k <= 2; ++k) { n.y[k] = NAN; }",
        (1.0, 2.0),
        (1.0, 2.0, NAN),
    ),
    Form("uint8[3]", "uint8[3]", "for (unsigned i = 0; i != 3; ++i) n.y[i] = o.x[i]; n.y[1] = 0;", b"abc", b"a\0c"),
    Form(
        "float32[2]",
        "float32[2]",
        "for (int i = 0; i < 2; ++i) n.y[i] = isnan(o.x[i]) ? -1 : o.x[i];",
        (NAN, 2.0),
        (-1.0, 2.0),
    ),
    Form("uint8[3]", "uint8[3]", "n.y[0] = o.x[2]; n.y[1] = o.x[1]; n.y[2] = o.x[0];", b"abc", b"cba"),
    Form("uint8[]", "uint8[]", "for (int i = 0; i < o.x.size(); ++i) n.y[i] = o.x[i];", b"abc", b"abc"),
    Form("uint8[]", "uint8[]", "for (int i = 1; i < o.x.size(); ++i) n.y[i] = o.x[i];", b"abc", LOST),
    Form("uint8[3]", "uint8[3]", "for (int i = 0; i < 4; ++i) n.y[i] = o.x[i];", b"abc", LOST),
    Form("uint8[3]", "uint8[3]", "for (int i = 0; i < 3; ++i) { n.y[i] = o.x[i]; i++; }", b"abc", LOST),
    Form("uint8[3]", "uint8[3]", "for (int i = 0; i < 3; ++i) { if (o.x[i]) break; n.y[i] = o.x[i]; }", b"abc", LOST),
    Form(
        "uint8[3]", "uint8[3]", "for (int i = 0; i < 3; ++i) for (int j = 0; j < 3; ++j) n.y[i] = o.x[j];", b"abc", LOST
    ),
    # statements that are not supported
    Form("uint8", "uint8", "n.y = o.x + 1;", 7, LOST),
    Form("uint8", "uint8", "n.y = static_cast<uint8_t>(o.x);", 7, LOST),
    Form("uint8", "uint8", "const auto x = o.x; n.y = x;", 7, LOST),
    Form("uint8", "uint8", "n.y = o.x; n.y += 1;", 7, LOST),
    Form("uint8", "uint8", "auto &y = n.y; y = o.x;", 7, LOST),
    Form("uint8", "uint8", "n.y = other(o.x);", 7, LOST),
    Form("uint8", "uint8", "while (n.y < o.x) { n.y++; }", 7, LOST),
    Form("uint8", "uint8", "switch (o.x) { case 1: n.y = 2; break; default: n.y = o.x; }", 7, LOST),
    Form("uint8[3]", "uint8[3]", "std::copy(o.x.begin(), o.x.end(), n.y.begin());", b"abc", LOST),
    Form("uint8", "uint8", "n.y = o.z;", 7, LOST),
    Form("uint8[2]", "uint8", "n.y = o.x[2];", b"ab", LOST),
]


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The package with a message for each form, numbered like the forms."""
    versions = {
        f"Form{number}": (f"uint8 TWO = 2\n{form.older} x\n", f"uint8 ONE = 1\n{form.newer} y\n")
        for number, form in enumerate(FORMS)
    }
    header = "".join(
        class_of(f"Form{number}", f"n.timestamp = o.timestamp; {form.statement}") for number, form in enumerate(FORMS)
    )
    return package_of(tree(versions, header), tmp_path_factory.mktemp("forms"))


@pytest.mark.parametrize("number", range(len(FORMS)), ids=[form.statement for form in FORMS])
def test_a_statement_sets_a_field_or_leaves_it_without_a_value(number: int, forms: Any) -> None:
    form = FORMS[number]
    newer = getattr(forms, f"Form{number}")
    converted = getattr(forms, f"Form{number}V0")(timestamp=5, x=form.value).upgrade()
    assert converted.message.timestamp == 5
    assert converted.defaulted == (("y",) if form.expected is LOST else ())
    expected = newer().y if form.expected is LOST else form.expected
    assert plain(converted.message.y) == plain(expected)
    assert type(converted.message.y) is type(newer().y)
    if "x" not in converted.dropped:
        assert form.expected is not LOST
        assert "o.x" in form.statement
    assert newer.decode(converted.message.encode()) == converted.message


# --- Dropped and defaulted fields


def test_elements_without_a_value_and_elements_that_are_lost_are_listed_as_such(tmp_path: Path) -> None:
    fewer = "for (int i = 0; i < 2; ++i) { n.y[i] = o.x[i]; } n.y[4] = o.x[0];"
    package = package_of(tree({"Servo": ("float32[4] x\n", "float32[6] y\n")}, class_of("Servo", fewer)), tmp_path)
    converted = package.ServoV0(x=(1.0, 2.0, 3.0, 4.0)).upgrade()
    assert converted.message.y == (1.0, 2.0, 0.0, 0.0, 1.0, 0.0)
    assert (converted.dropped, converted.defaulted) == (("x[2:4]",), ("y[2:4]", "y[5]"))


def test_elements_that_are_not_set_keep_the_default_of_the_definition(tmp_path: Path) -> None:
    versions = {"Servo": ("uint8 x\n", "uint8[3] y [7, 8, 9]\n")}
    package = package_of(tree(versions, class_of("Servo", "n.y[1] = o.x;")), tmp_path)
    converted = package.ServoV0(x=1).upgrade()
    assert (converted.message.y, converted.defaulted) == (b"\7\1\11", ("y[0]", "y[2]"))


def test_a_field_that_several_are_made_of_is_not_lost(tmp_path: Path) -> None:
    versions = {"Home": ("float32 hagl\nuint8 gone\n", "float32 one\nfloat32 two\nbool high\nuint8 new\n")}
    up = "n.one = o.hagl; n.two = o.hagl; n.high = o.hagl > 2.0f;"
    package = package_of(tree(versions, class_of("Home", up)), tmp_path)
    converted = package.HomeV0(timestamp=3, hagl=2.5, gone=1).upgrade()
    assert converted.message == package.Home(timestamp=3, one=2.5, two=2.5, high=True)
    assert (converted.dropped, converted.defaulted) == (("gone",), ("new",))


def test_fields_that_get_the_same_value_share_nothing(tmp_path: Path) -> None:
    versions = {
        "Event": ("uint32 id\n", "uint32 id\n"),
        "Gust": ("float32[20] x\nEventV0 e\n", "float32[20] x\nfloat32[20] y\nEvent f\nEvent g\n"),
    }
    up = "n.x = o.x; n.y = o.x; EventV1Translation::fromOlder(o.e, n.f); EventV1Translation::fromOlder(o.e, n.g);"
    package = package_of(tree(versions, class_of("Event", "n.id = o.id;") + class_of("Gust", up)), tmp_path)
    new = package.GustV0(e=package.EventV0(id=3)).upgrade().message
    new.x[0], new.f.id = 5.0, 4
    assert (new.y[0], new.g.id) == (0.0, 3)


def test_a_value_that_its_field_cannot_hold_is_dropped_where_no_other_field_has_it(tmp_path: Path) -> None:
    versions = {"Mask": ("uint16 wide\nuint16 other\n", "uint8 a\nuint16 b\nuint8 c\n")}
    up = "n.a = o.wide; n.b = o.wide; n.c = o.other > 5 ? o.other : 0;"
    package = package_of(tree(versions, class_of("Mask", up)), tmp_path)
    converted = package.MaskV0(wide=300, other=300).upgrade()
    assert (converted.message, converted.dropped, converted.defaulted) == (package.Mask(b=300), ("other",), ("a", "c"))
    assert package.MaskV0(wide=30, other=30).upgrade().defaulted == ()


def test_a_field_of_the_same_name_that_is_set_in_an_unclear_way_is_not_carried_over(tmp_path: Path) -> None:
    """The same value would usually be wrong; a field that the header does not mention is carried over by name."""
    versions = {"Gust": ("float32 scaled\nuint8 count\n", "float32 scaled\nuint8 count\n")}
    package = package_of(tree(versions, class_of("Gust", "n.scaled = o.scaled * 0.01f;")), tmp_path)
    converted = package.GustV0(timestamp=1, scaled=250.0, count=3).upgrade()
    assert (converted.message, converted.dropped) == (package.Gust(timestamp=1, count=3), ("scaled",))
    assert converted.defaulted == ("scaled",)
    assert package.Gust(scaled=2.0).downgrade().defaulted == ()


UNLIKE = [("float32[2]", "float32"), ("float32", "float32[2]"), ("Inner", "uint8"), ("uint8", "Inner")]


@pytest.mark.parametrize(("older", "newer"), UNLIKE)
def test_a_field_is_no_copy_of_one_whose_values_it_cannot_have(older: str, newer: str, tmp_path: Path) -> None:
    """No compiler accepts such a header. It is not told as a copy, and the field keeps its default."""
    inner = {"msg/Inner.msg": "uint64 timestamp\nuint8 x\n", f"{ARCHIVE}/InnerV0.msg": "uint64 timestamp\nuint8 x\n"}
    versions = {"Mix": (f"{older.replace('Inner', 'InnerV0')} a\n", f"{newer} b\n")}
    package = package_of(tree(versions, class_of("Mix", "n.timestamp = o.timestamp; n.b = o.a;"), **inner), tmp_path)
    assert "`b` from `a`" not in package.MixV0.upgrade.__doc__
    assert package.MixV0(timestamp=1).upgrade().defaulted == ("b",)


@pytest.mark.parametrize(
    ("then", "otherwise"),
    [
        ("n.y = unknown(o.x);", "n.y[0] = 1; n.y[1] = 2;"),
        ("n.y[0] = 1; n.y[1] = 2;", "n.y = unknown(o.x);"),
        ("n.y = o.x;", "n.y[0] = 1; n.y[1] = 2;"),
        ("n.y[0] = 1; n.y[1] = 2;", "n.y = o.x;"),
    ],
)
def test_a_choice_with_a_side_that_is_not_read_by_elements_is_unclear(
    then: str, otherwise: str, tmp_path: Path
) -> None:
    versions = {"Pick": ("bool on\nint16[2] x\n", "int16[2] y\n")}
    up = f"n.timestamp = o.timestamp; if (o.on) {{ {then} }} else {{ {otherwise} }}"
    package = package_of(tree(versions, class_of("Pick", up)), tmp_path)
    for on in (False, True):
        converted = package.PickV0(timestamp=1, on=on, x=(3, 4)).upgrade()
        assert (converted.message, converted.defaulted) == (package.Pick(timestamp=1), ("y",))


DOCUMENTED = """Return the message as version 1, and the fields that could not be copied.

        Fields that PX4's translation does not copy by name:

        - `source` from `index`
        - `synthetic` = NaN
        - `state` = DONE
        - `gain` = 0.1
        - `alt` = `alt if valid else NaN`
        - `control[0:2]` from `control[0:2]`, `control[2:4]` = 0.0
        - `mode` keeps its default: the statement could not be parsed

        Fields that are copied by name, although PX4's translation omits them: `count`.

        Raises EncodeError for a value that its field cannot hold.
        """
LONG = {
    "Speed": (
        "int8 index\nfloat32 alt\nbool valid\nfloat32[2] control\nuint8 mode\nuint8 count\n",
        """uint8 DONE = 4
int8 source
float32 synthetic
uint8 state
float32 gain
float32 alt
float32[4] control
uint8 mode
uint8 count
""",
    )
}
LONG_UP = """
n.timestamp = o.timestamp;
n.source = o.index;
n.synthetic = NAN;
n.state = MessageNewer::DONE;
n.gain = 0.1f;
n.alt = o.valid ? o.alt : NAN;
for (int i = 0; i < 2; ++i) { n.control[i] = o.control[i]; }
for (int i = 2; i < 4; ++i) { n.control[i] = 0; }
n.mode = o.mode | 1;
"""


def test_the_docstring_of_a_method_says_what_the_header_does(tmp_path: Path) -> None:
    package = package_of(tree(LONG, class_of("Speed", LONG_UP)), tmp_path)
    assert package.SpeedV0.upgrade.__doc__ == DOCUMENTED
    assert "count" in package.Speed.downgrade.__doc__


def test_a_translation_that_cannot_be_read_at_all_is_said_in_the_docstring(tmp_path: Path) -> None:
    package = package_of(tree({"Lamp": ("uint8 x\n", "uint8 x\n")}, class_of("Lamp", "copy(o, n);")), tmp_path)
    assert "PX4's translation could not be parsed: all fields are copied" in package.LampV0.upgrade.__doc__
    assert package.LampV0(x=3).upgrade().message.x == 3


OPAQUE = [
    "fill(n); n.x = 1;",
    "n.x = 1; if (o.x) { return; } n.x = 2;",
    "auto *p = &n; p->x = 1; n.x = 1;",
    "COPY_ALL_FIELDS n.x = 1;",
    "COPY_ALL(FIELDS); n.x = 1;",
    "n.x = 1;\n#if OLD\nn.x = 2;\n#endif\n",
    "n = MessageNewer();",
    "n.x = 1; ) n.x = 2;",
    "n.x = 1; if o.x) { n.x = 2; }",
]


@pytest.mark.parametrize("statements", OPAQUE)
def test_where_any_field_may_be_set_nothing_is_said(statements: str) -> None:
    (found,) = read_translations(class_of("Lamp", statements, "o.x = 2;"))
    assert found.from_older is None
    assert found.to_older == (Assignment(Place(is_target=True, path=(Step("x"),)), Number(2)),)


# --- Whole headers


def test_macros_of_the_header_are_expanded(tmp_path: Path) -> None:
    macros = """
#define COMMON(FUNCTION) \\
    FUNCTION(timestamp) /* said twice */ \\
    FUNCTION(x)
#define COPY(field) n.field = o.field;
#define RENAME(to, from) n.to = o.from;
#define FIVE 5
"""
    up = "COMMON(COPY) RENAME(b, a) n.c = FIVE;"
    text = (
        class_of("Lamp", up).replace("public:", f"public:{macros}")
        + "#undef COPY\n"
        + class_of("Fan", "n.b = 1; COPY(x)")
    )
    versions = {"Lamp": ("uint8 x\nuint8 a\n", "uint8 x\nuint8 b\nuint8 c\n"), "Fan": ("uint8 x\n", "uint8 b\n")}
    package = package_of(tree(versions, text), tmp_path)
    converted = package.LampV0(1, 2, 3).upgrade()
    assert (converted.message, converted.dropped, converted.defaulted) == (package.Lamp(1, 2, 3, 5), (), ())
    assert package.FanV0().upgrade().defaulted == ("b",)


def test_nested_messages_are_translated_by_their_own_translation(tmp_path: Path) -> None:
    nested = {
        "Event": ("uint32 id\nuint8 level\n", "uint32 number\nuint8 level\n"),
        "Reply": ("EventV0[2] events\nEventV0 main\nEventV0 last\n", "Event[2] events\nEvent first\nEvent last\n"),
    }
    header = class_of("Event", "n.number = o.id; n.level = o.level;", "o.id = n.number; o.level = n.level;")
    up = """for (std::size_t i = 0; i < n.events.size(); i++) {
        EventV1Translation::fromOlder(o.events.at(i), n.events[i]);
    }
    EventV1Translation::fromOlder(o.main, n.first);
    EventV1Translation::fromOlder(o.last, n.last);"""
    package = package_of(tree(nested, header + class_of("Reply", up)), tmp_path)
    events = [package.EventV0(id=number, level=1) for number in range(4)]
    converted = package.ReplyV0(events=tuple(events[:2]), main=events[2], last=events[3]).upgrade()
    new = converted.message
    assert [event.number for event in (*new.events, new.first, new.last)] == [0, 1, 2, 3]
    assert (converted.dropped, converted.defaulted) == ((), ())
    back = new.downgrade()
    assert [event.id for event in back.message.events] == [0, 1]
    assert (back.dropped, back.defaulted) == (("first",), ("main",))


def test_nested_fields_that_are_set_one_by_one_are_carried_over_by_name(tmp_path: Path) -> None:
    nested = {
        "Event": ("uint32 id\n", "uint32 id\nuint8 added\n"),
        "Good": ("EventV0[2] events\n", "Event[2] events\n"),
        "Bad": ("EventV0[2] events\n", "Event[2] events\n"),
    }
    loop = "for (std::size_t i = 0; i < n.events.size(); ++i) {{ n.events[i].id = {}; n.events[i].added = 0; }}"
    header = class_of("Good", loop.format("o.events[i].id")) + class_of("Bad", loop.format("5"))
    package = package_of(tree(nested, header), tmp_path)
    old = (package.EventV0(id=3), package.EventV0(id=4))
    good, bad = package.GoodV0(events=old).upgrade(), package.BadV0(events=old).upgrade()
    assert [event.id for event in good.message.events] == [3, 4]
    assert (good.dropped, good.defaulted) == ((), ("events.added",))
    assert (bad.dropped, bad.defaulted) == (("events",), ("events",))


def chain_of(folder: Path) -> Any:
    files = {
        f"{ARCHIVE}/LampV0.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 a\nuint8 old\n",
        f"{ARCHIVE}/LampV1.msg": "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nuint8 b\nuint8 two\nuint8 new\n",
        "msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 2\nuint64 timestamp\nuint8 c\nuint8 d\nuint8 e\n",
        f"{HEADERS}/all_translations.h": '#include "one.h"\n#include "two.h"\n',
        f"{HEADERS}/one.h": class_of(
            "Lamp", "n.b = o.a; n.two = 2;", "o.a = n.b; o.old = 7;", newer="px4_msgs_old::msg::LampV1"
        ),
        f"{HEADERS}/two.h": class_of(
            "Lamp", "n.c = o.b; n.d = o.two; n.e = o.new;", "o.b = n.c;", older="px4_msgs_old::msg::LampV1"
        ),
    }
    return package_of(files, folder)


def test_several_versions_are_passed_one_by_one(tmp_path: Path) -> None:
    """A field without a value in one version has none in the next, and does not count as dropped when it is removed."""
    package = chain_of(tmp_path)
    convert = importlib.import_module(f"{package.__name__}.versions").convert
    old, new = package.LampV0(1, 2, 3), package.Lamp(4, 5, 6, 7)
    up, down = convert(old, package.Lamp), convert(new, package.LampV0)
    assert up.message == old.upgrade().message.upgrade().message == package.Lamp(1, 2, 2, 0)
    assert (up.dropped, up.defaulted) == (("old",), ("e",))
    assert down.message == new.downgrade().message.downgrade().message == package.LampV0(4, 5, 7)
    assert (down.dropped, down.defaulted) == (("d", "e"), ())
    assert convert(old, package.LampV1) == old.upgrade()


def test_a_translation_to_a_message_of_another_name_is_known_to_convert_alone(tmp_path: Path) -> None:
    files = tree(
        {"Position": ("float64 lat\nfloat32 alt\nbool alt_valid\n", "float64 lat\n")},
        class_of(
            "Aux",
            "n.id = 1; n.lat = o.lat; n.alt = o.alt_valid ? o.alt : NAN;",
            "o.lat = n.lat; o.alt = n.alt; o.alt_valid = !std::isnan(n.alt);",
            older="px4_msgs_old::msg::PositionV0",
        ),
    )
    files["msg/versioned/Aux.msg"] = (
        "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nuint8 id\nfloat64 lat\nfloat32 alt\n"
    )
    files["msg/Fan.msg"] = "uint64 timestamp\n"
    package = package_of(files, tmp_path)
    convert = importlib.import_module(f"{package.__name__}.versions").convert
    converted = convert(package.PositionV0(1, 2.0, 3.0, alt_valid=False), package.Aux)
    assert (converted.message, converted.dropped) == (package.Aux(1, 1, 2.0, NAN), ())
    assert convert(converted.message, package.PositionV0).message.alt_valid is False
    assert not hasattr(package.Aux, "downgrade")
    for target in (package.Fan, package.Position):
        with pytest.raises(TypeError, match="is not a version of px4_msgs/msg/Aux"):
            convert(converted.message, target)


def test_headers_that_are_not_included_say_nothing(tmp_path: Path) -> None:
    files = tree({"Lamp": ("uint8 x\n", "uint8 y\n")}, class_of("Lamp", "n.y = o.x;"))
    for include, defaulted in (
        ('#include "translations.h"\n', ()),
        ('#include "more.h"\n', ()),
        ('// #include "translations.h"\n/*\n#include "translations.h"\n*/', ("y",)),
        ("", ("y",)),
    ):
        files[f"{HEADERS}/all_translations.h"] = include
        files[f"{HEADERS}/more.h"] = '#include "translations.h"\n#include "more.h"\n'
        folder = tmp_path / str(len(include))
        assert package_of(files, folder).LampV0(x=1).upgrade().defaulted == defaulted
    del files[f"{HEADERS}/all_translations.h"]
    assert read_headers({"translations.h": class_of("Lamp", "n.y = o.x;")}) == ()


def test_translations_of_services_and_of_several_topics_are_not_read() -> None:
    several = """class S { using MessagesOlder = TypesArray<px4_msgs_old::msg::AV1, px4_msgs_old::msg::BV1>;
    static void fromOlder(const MessagesOlder::Type1 &a, const MessagesOlder::Type2 &b,
      MessagesNewer::Type1 &c, MessagesNewer::Type2 &d) { c.x = a.x; } };"""
    service = class_of("S", "n.x = 1;", older="px4_msgs_old::srv::SV0", newer="px4_msgs::srv::S").replace(
        " &o", "::Request &o"
    )
    assert read_translations(several) == ()
    (found,) = read_translations(service)
    assert (found.from_older, found.to_older) == (None, None)


def test_a_package_without_headers_carries_over_by_name(tmp_path: Path) -> None:
    files = tree({"Lamp": ("uint8 x\n", "uint8 y\n")}, "")
    converted = package_of(files, tmp_path).LampV0(x=1).upgrade()
    assert (converted.dropped, converted.defaulted) == (("x",), ("y",))


def test_the_header_that_bump_writes_is_read(working_folder: Path) -> None:
    files = {
        "msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 x\nfloat32[2] gone\n",
        "msg/px4_msgs_old/msg/.keep": "",
        "msg/translation_node/.keep": "",
        "src/modules/x": "",
    }
    write_definitions(working_folder, files)
    newer = {"msg/versioned/Lamp.msg": files["msg/versioned/Lamp.msg"].replace("float32[2] gone", "float32 level")}
    for command in (("init", "-q"), ("add", "."), ("-c", "user.name=a", "-c", "user.email=b", "commit", "-qm", "c")):
        subprocess.run(["git", *command], check=True)
    write_definitions(working_folder, newer)
    assert main(["bump", "Lamp"]) == DONE
    package = import_package(read_catalog(with_archived(find_sources("."))), working_folder / "out")
    up = package.LampV0(x=1).upgrade()
    assert (up.message, up.dropped, up.defaulted) == (package.Lamp(x=1), ("gone",), ())
    assert "could not be parsed" not in package.LampV0.upgrade.__doc__ + package.Lamp.downgrade.__doc__


# --- Hostile headers

HOSTILE = {
    "nothing": "",
    "an open comment": "class A { /* " + class_of("Lamp", "n.y = o.x;"),
    "comments in comments": "/* /* */ */" + class_of("Lamp", "/* /* */ n.y = /**/ o.x; // /*"),
    "an open string": 'class A { const char *x = "' + class_of("Lamp", "n.y = o.x;"),
    "open brackets": "class A { " + "([{" * 20_000,
    "closed brackets": ")]}" * 20_000 + class_of("Lamp", "n.y = o.x;"),
    "many parentheses": class_of("Lamp", f"n.y = {'(' * 5000}o.x{')' * 5000};"),
    "many signs": class_of("Lamp", f"n.y = {'!' * 5000}o.x;"),
    "many choices": class_of("Lamp", f"n.y = {'o.x ? 1 : ' * 5000}2;"),
    "many operators": class_of("Lamp", f"n.y = {'o.x || ' * 5000}o.x;"),
    "many conditions": class_of("Lamp", "if (o.x == 1) { n.y = 1; } else " * 5000 + "n.y = 2;"),
    "conditions in conditions": class_of("Lamp", "n.y = 0; " + "if (o.x == 1) { if (o.x == 2) { n.y = 1; } } " * 500),
    "many elements": class_of("Lamp", "".join(f"n.z[{index}] = o.x; " for index in range(20_000))),
    "many blocks": class_of("Lamp", "{" * 5000 + "n.y = o.x;" + "}" * 5000),
    "many loops": class_of("Lamp", "for (int i = 0; i < 9; ++i) " * 5000 + "n.y = o.x;"),
    "a long loop": class_of("Lamp", f"for (int i = 0; i < {'9' * 4000}; ++i) n.y = 1;"),
    "a long number": class_of("Lamp", f"n.y = {'9' * 10_000};"),
    "a longer number": class_of("Lamp", f"n.y = 1e{'9' * 10_000};"),
    "many statements": class_of("Lamp", "n.y = o.x; " * 20_000),
    "many classes": "class A { " * 20_000,
    "many names": "class A " * 20_000,
    "many functions": "class A { using MessageOlder = a; using MessageNewer = b; " + "fromOlder(" * 20_000,
    "a macro of itself": "#define A A A\n" + class_of("Lamp", "A n.y = o.x;"),
    "macros without end": "".join(f"#define M{n} M{n + 1} M{n + 1}\n" for n in range(40)) + class_of("Lamp", "M0"),
    "empty macros without end": "".join(f"#define M{n} M{n + 1} M{n + 1}\n" for n in range(18))
    + "#define M18\n"
    + class_of("Lamp", "M0"),
    "a macro left open": "#define F(x) x\n" + "F(" * 20_000,
    "arguments that grow": "#define D(x) x x x x x x x x\n" + "D(" * 15 + "n.y" + ")" * 15,
    "no text": "\0\ufffd\u202e" * 1000,
    "a line without end": "\\\n" * 100_000,
    "huge": class_of("Lamp", "n.y = o.x;") * 20_000,
}


@pytest.mark.slow
@by_day("kind", HOSTILE, 6)
def test_no_header_hangs_or_fails(kind: str, tmp_path: Path) -> None:
    started = time.process_time()
    files = tree({"Lamp": ("uint8 x\n", "uint8 y\nuint8[20000] z\n")}, HOSTILE[kind])
    render_package(catalog_of(tmp_path, files), "lamps")
    assert time.process_time() - started < 10


WHOLE = class_of("Speed", LONG_UP, "o.index = n.source; if (n.state > 3) { o.mode = 1; } else { o.mode = n.mode; }")


@pytest.fixture(scope="module")
def speed(tmp_path_factory: pytest.TempPathFactory) -> Catalog:
    return catalog_of(tmp_path_factory.mktemp("speed"), tree(LONG, ""))


@pytest.mark.slow
@settings(max_examples=examples(300, by_day=40))
@given(data=st.data())
def test_a_header_that_is_cut_or_garbled_gives_rules_that_python_reads(data: st.DataObject, speed: Catalog) -> None:
    start = data.draw(st.integers(0, len(WHOLE)))
    stop = data.draw(st.integers(start, len(WHOLE)))
    put = data.draw(
        st.sampled_from(["", "{", "}", "(", ")", ";", "/*", '"', "n", "#", "\\", "for (", "if (", "?", "\0"])
    )
    found = read_translations(WHOLE[:start] + put + WHOLE[stop:])
    for conversion in translation_table(speed._replace(translations=found)).conversions:
        ast.parse(f"Translation({', '.join(conversion.arguments)})")


# --- Random translations against a simple interpreter

FIELDS = {"a": "uint8", "b": "int16", "c": "float32", "d": "bool", "e": "float32[4]", "f": "uint8[3]", "g": "uint16[2]"}
LENGTHS = {"e": 4, "f": 3, "g": 2}
KINDS = {"a": "integer", "b": "integer", "c": "float", "d": "bool", "e": "float", "f": "integer", "g": "integer"}


CONSTANTS: dict[str, list[tuple[str, float]]] = {
    "bool": [("true", True), ("false", False)],
    "integer": [("7", 7), ("0x1F", 31)],
    "float": [("NAN", NAN), ("-2.5f", -2.5), ("3", 3.0)],
}


class Run:
    """Generates statements, and functions that apply them to a target with the fields FIELDS, as a dictionary."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance

    def statements(self, depth: int = 0) -> tuple[str, Any]:
        made = [self.statement(depth) for _ in range(self.chance.randint(1, 5))]

        def run(o: dict[str, Any], n: dict[str, Any]) -> None:
            for _, each in made:
                each(o, n)

        return " ".join(text for text, _ in made), run

    def statement(self, depth: int) -> tuple[str, Any]:
        if depth < 2 and self.chance.random() < 0.2:
            return self.branch(depth)
        name = self.chance.choice(list(FIELDS))
        if name not in LENGTHS:
            text, value = self.value(KINDS[name], None)
            return f"n.{name} = {text};", lambda o, n: n.update({name: value(o, 0)})
        if self.chance.random() < 0.5:
            index = self.chance.randrange(LENGTHS[name])
            text, value = self.value(KINDS[name], None)
            return f"n.{name}[{index}] = {text};", lambda o, n: n[name].__setitem__(index, value(o, 0))
        return self.loop(name)

    def loop(self, name: str) -> tuple[str, Any]:
        start = self.chance.randrange(LENGTHS[name])
        stop = self.chance.randint(start, LENGTHS[name])
        text, value = self.value(KINDS[name], stop)

        def run(o: dict[str, Any], n: dict[str, Any]) -> None:
            for index in range(start, stop):
                n[name][index] = value(o, index)

        return f"for (int i = {start}; i < {stop}; ++i) {{ n.{name}[i] = {text}; }}", run

    def branch(self, depth: int) -> tuple[str, Any]:
        text, condition = self.condition(None)
        (then, run_then), (otherwise, run_otherwise) = self.statements(depth + 1), self.statements(depth + 1)

        def run(o: dict[str, Any], n: dict[str, Any]) -> None:
            (run_then if condition(o, 0) else run_otherwise)(o, n)

        return f"if ({text}) {{ {then} }} else {{ {otherwise} }}", run

    def value(self, kind: str, stop: int | None) -> tuple[str, Any]:
        if kind == "bool" and self.chance.random() < 0.5:
            return self.condition(stop)
        if self.chance.random() < 0.2:
            condition, one, other = self.condition(stop), self.value(kind, stop), self.value(kind, stop)
            text = f"({condition[0]} ? {one[0]} : {other[0]})"
            return text, lambda o, i: one[1](o, i) if condition[1](o, i) else other[1](o, i)
        if self.chance.random() < 0.3:
            text, constant = self.chance.choice(CONSTANTS[kind])
            return text, lambda _o, _i: constant
        names = [name for name in FIELDS if KINDS[name] == kind]
        return self.read(self.chance.choice(names), stop)

    def read(self, name: str, stop: int | None) -> tuple[str, Any]:
        if name not in LENGTHS:
            return f"o.{name}", lambda o, _i: o[name]
        if stop is not None and stop <= LENGTHS[name] and self.chance.random() < 0.7:
            return f"o.{name}[i]", lambda o, i: o[name][i]
        index = self.chance.randrange(LENGTHS[name])
        return f"o.{name}[{index}]", lambda o, _i: o[name][index]

    def condition(self, stop: int | None) -> tuple[str, Any]:
        kind = self.chance.choice(["isnan", "compare", "both", "not", "field"])
        if kind == "field":
            return self.read("d", stop)
        if kind == "isnan":
            text, value = self.read(self.chance.choice("ce"), stop)
            return f"std::isnan({text})", lambda o, i: math.isnan(value(o, i))
        if kind == "not":
            text, value = self.condition(stop)
            return f"!({text})", lambda o, i: not value(o, i)
        if kind == "both":
            one, other = self.condition(stop), self.condition(stop)
            return f"{one[0]} && ({other[0]})", lambda o, i: one[1](o, i) and other[1](o, i)
        text, value = self.read(self.chance.choice("abfg"), stop)
        return f"{text} >= 4", lambda o, i: value(o, i) >= 4


RANDOM_HEADERS = 40


@pytest.fixture(scope="module")
def random_headers(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, list[Any]]:
    chance = Random(11)  # noqa: S311 - not used for security
    made = [Run(chance).statements() for _ in range(RANDOM_HEADERS)]
    fields = "".join(f"{type_} {name}\n" for name, type_ in FIELDS.items())
    # Set every field first, so that a branch that does not set it leaves it with a value.
    zeros = " ".join(f"n.{name} = {'{}' if name in LENGTHS else 0};" for name in FIELDS)
    versions = {f"Run{number}x": (fields, fields) for number in range(RANDOM_HEADERS)}
    header = "".join(class_of(f"Run{number}x", f"{zeros} {text}") for number, (text, _) in enumerate(made))
    return package_of(tree(versions, header), tmp_path_factory.mktemp("random")), [run for _, run in made]


@pytest.mark.parametrize("number", range(RANDOM_HEADERS))
def test_random_translations_do_what_they_say(number: int, random_headers: tuple[Any, list[Any]]) -> None:
    """Each value is the result of running the statements in order; fields that get no valid value are listed."""
    package, runs = random_headers
    chance = Random(number)  # noqa: S311 - not used for security
    for _ in range(30):
        old: dict[str, Any] = {
            "a": chance.randrange(256),
            "b": chance.randint(-10, 10),
            "c": chance.choice([NAN, 1.5, -8.0]),
            "d": chance.random() < 0.5,
            "e": [chance.choice([NAN, 0.25, 1e9]) for _ in range(4)],
            "f": [chance.randrange(9) for _ in range(3)],
            "g": [chance.choice([1, 300]) for _ in range(2)],
        }
        given_values = {name: tuple(value) if isinstance(value, list) else value for name, value in old.items()}
        given_values["f"] = bytes(old["f"])
        converted = getattr(package, f"Run{number}xV0")(**given_values).upgrade()
        new: dict[str, Any] = {name: [0] * LENGTHS[name] if name in LENGTHS else 0 for name in FIELDS}
        new["d"] = False
        runs[number](old, new)
        limits = {"a": (0, 255), "b": (-(2**15), 2**15 - 1), "f": (0, 255), "g": (0, 2**16 - 1)}
        for name, value in new.items():
            low, high = limits.get(name, (-INF, INF))
            several = value if isinstance(value, list) else [value]
            fits = all(math.isnan(one) or low <= one <= high for one in several)
            assert (name in converted.defaulted) == (not fits)
            if fits:
                found = getattr(converted.message, name)
                found = list(found) if name in LENGTHS else [found]
                assert [repr(float(one)) for one in found] == [repr(float(one)) for one in several]


# --- Sources


@pytest.fixture
def lamp(working_folder: Path) -> Path:
    return write_definitions(
        working_folder / "in", tree({"Lamp": ("uint8 x\n", "uint8 y\n")}, class_of("Lamp", "n.y = o.x;"))
    )


def test_a_build_is_stale_when_a_header_changes(lamp: Path) -> None:
    arguments = ["build", "-q", "--archived", "--px4", "in", "-o", "out", "--depfile", "deps"]
    assert main(arguments) == DONE
    assert main([*arguments, "--check"]) == DONE
    header = lamp / HEADERS / "translations.h"
    assert str(Path("in") / HEADERS / "translations.h") in Path("deps").read_text()
    header.write_text(header.read_text().replace("o.x", "5"))
    assert main([*arguments, "--check"]) == FINDINGS
    assert main(arguments) == DONE
    assert 'Constant("y", 5)' in Path("out/px4_types/translations.py").read_text()


def test_every_kind_of_source_gives_its_headers(lamp: Path) -> None:
    with tarfile.open("in.tar", "w") as packed:
        packed.add("in")
    for command in (("init", "-q"), ("add", "."), ("-c", "user.name=a", "-c", "user.email=b", "commit", "-qm", "c")):
        subprocess.run(["git", *command], cwd=lamp, check=True)
    for source in (("--px4", "in.tar"), ("--px4", "in@HEAD"), ("--msg-dir", "in"), ("--msg-dir", "in/msg")):
        assert main(["build", "-q", "--archived", *source, "-o", "out"]) == DONE
        assert 'Copied("y", "x")' in Path("out/px4_types/translations.py").read_text()


def test_headers_are_not_read_where_versions_are_not_asked_for(lamp: Path) -> None:
    (lamp / HEADERS / "translations.h").chmod(0)
    sources = find_sources(str(lamp))
    assert not any(file.name.endswith(".h") for file in sources.files())
    catalog = read_catalog(sources)
    assert catalog.translations == ()
    assert "translations.py" not in list_package(catalog)


# --- Types


@pytest.fixture(scope="module")
def typed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a package that has rules of every kind."""
    folder = tmp_path_factory.mktemp("typed")
    versions = {
        **{
            f"Form{number}": (f"uint8 TWO = 2\n{form.older} x\n", f"uint8 ONE = 1\n{form.newer} y\n")
            for number, form in enumerate(FORMS)
        },
        **LONG,
        "ConditionThatIsLong": ("float32[8] value_of_the_older_version\n", "bool is_valid\n"),
    }
    long = " && ".join(f"std::isfinite(o.value_of_the_older_version[{index}])" for index in range(8))
    header = "".join(
        [
            *(class_of(f"Form{number}", form.statement) for number, form in enumerate(FORMS)),
            class_of("Speed", LONG_UP),
            class_of("ConditionThatIsLong", f"n.is_valid = {long};"),
        ]
    )
    catalog = catalog_of(folder / "in", tree(versions, header))
    for path, text in render_package(catalog, "rules").items():
        write_definitions(folder / "rules", {path: text})
    return folder


MODULES = ["rules/translations.py", "rules/versions.py", "rules/msg/_speed_v0.py"]


def checked(folder: Path, *command: str) -> None:
    done = subprocess.run([sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.night  # each run does it with pyright
def test_mypy_is_content_with_the_rules(typed: Path) -> None:
    done = mypy(typed, *MODULES)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.night  # by day, mypy is
def test_pyright_is_content_with_the_rules(typed: Path) -> None:
    configuration = {"include": MODULES, "typeCheckingMode": "strict", "pythonVersion": "3.10"}
    (typed / "pyrightconfig.json").write_text(json.dumps(configuration))
    checked(typed, "basedpyright", "--level", "error", "--pythonpath", sys.executable, "-p", str(typed))


def test_ruff_is_content_with_the_rules(typed: Path) -> None:
    rules = ("--select=E,F,W,B,C4,PLE,SIM,UP", "--ignore=B905,UP007", "--line-length=130")
    checked(typed, "ruff", "check", "--isolated", "--target-version=py310", *rules, *MODULES)


def test_names_are_found_with_their_lines() -> None:
    """Methods of arrays and types that ROS 2 adds are no names of fields."""
    text = """#pragma once
#define COPY(name) \\
	to.name = from.name
struct T {
	using MessageOlder = px4_msgs_old::msg::AV0;
	using MessageNewer = px4_msgs::msg::A;
	static void fromOlder(const MessageOlder &from, MessageNewer &to) {
		to.b[0].c = from.d.at(1).e; // from.comment
		to.f.resize(from.g.size());
		if (from.h == MessageOlder::KIND_A) { MessageNewer::SharedPtr other; }
		COPY(i);
	}
};
"""
    [found] = read_classes(text)
    names = [(each.is_older, each.path, each.line) for each in found.references]
    assert names == [
        (False, ("b", "c"), 8),
        (True, ("d", "e"), 8),
        (False, ("f",), 9),
        (True, ("g",), 9),
        (True, ("h",), 10),
        (True, ("KIND_A",), 10),
        (False, ("i",), 3),
        (True, ("i",), 3),
    ]


@pytest.mark.parametrize("character", "\v\f\r\t\x85\u2028")
def test_only_line_feeds_begin_a_line(character: str) -> None:
    text = f"""{character * 5}
struct T {{
	using MessageOlder = px4_msgs_old::msg::AV0;{character}
	using MessageNewer = px4_msgs::msg::A;
	static void fromOlder(const MessageOlder &from, MessageNewer &to) {{
		to.b = from.b;
	}}
}};
"""
    [found] = read_classes(text)
    assert {each.line for each in found.references} == {6}


@pytest.mark.parametrize(
    ("up", "is_lost"),
    [
        ("n.y = 1;", True),
        ("n.y = -1;", True),
        ("n.y = {};", True),
        ("for (int i = 0; i < 2; ++i) { n.z[i] = 0; } n.y = o.y;", True),
        ("n.y = o.y;", False),
        ("n.y = o.y > 5 ? 1 : 0;", False),
        ("if (o.y > 5) { n.y = 1; } else { n.y = 0; }", False),
        ("for (int i = 0; i < 2; ++i) { if (o.z[i] > 5) { n.z[i] = 1; } else { n.z[i] = 0; } } n.y = o.y;", False),
        ("n.y = 0; n.y = o.y;", False),
        ("n.y = unknown(o.y);", False),
    ],
)
def test_what_loses_a_value(up: str, is_lost: bool) -> None:  # noqa: FBT001
    text = "uint32 MESSAGE_VERSION = {}\nuint64 timestamp\n{} y\nuint8[2] z\n"
    older, _ = parse_message(text.format(0, "uint16"), "LampV0.msg", "LampV0", "px4_msgs_old")
    newer, _ = parse_message(text.format(1, "uint8"), "Lamp.msg", "Lamp", "px4_msgs")
    versions = Version(older, lambda *_: None), Version(newer, lambda *_: None, is_current=True)
    found = [*lost_values(class_of("Lamp", up), *versions, {})]
    assert bool(found) == is_lost
    assert all(each.text.startswith(("sets newer.y to", "sets newer.z to")) for each in found)
