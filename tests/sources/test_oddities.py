"""Tests of unusual definitions: the verdicts of PX4's generator, a C++ compiler, ROS 2 and msggen on each.

The tests run the real genmsg and rosidl, and g++ if it is installed. A definition that PX4 builds is no error in any
command. tests/sources/unusual.md has the same table for readers, and a test compares the two.
"""

from __future__ import annotations

import itertools
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from msggen.base.diagnostics import CODES, InputError, Level
from msggen.cli import DONE, FAILED, main
from support.catalogs import catalog_of, write_definitions
from support.examples import by_day
from support.px4_scripts import snake_case, topics
from support.rosidl import COMPILER, NO, YES, ask_rosidl

STAMP = "uint64 timestamp\n"
SIZED = {"bool", "char", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"}
"""The types that PX4's helper knows."""


class Row(NamedTuple):
    """A row of the table: `shown` as text, the verdicts of PX4 and ROS 2 on `files`, and the code of msggen, or ""."""

    shown: str
    px4: str
    ros: str
    code: str
    files: dict[str, str]


def row(shown: str, px4: str, ros: str, code: str = "", text: str = "") -> Row:
    """Return a row for one message with a timestamp and `text`, which defaults to the code in `shown`."""
    lines = text or "\n".join(re.findall(r"`([^`]+)`", shown)) + "\n"
    return Row(shown, px4, ros, code, {"Foo.msg": STAMP + lines})


def files(shown: str, px4: str, ros: str, code: str, *names: str) -> Row:
    """Return a row for messages with these names, each with only a timestamp."""
    return Row(shown, px4, ros, code, {f"{name}.msg": STAMP for name in names})


ROWS = [
    row("`uint8 from`, `uint8 decode`, `uint8 lazy`", YES, YES),
    row("`uint8 BANDS = 1` beside `uint8 bands`", YES, YES),
    row("`uint8 max__speed`, `uint8 max_`", YES, NO, "M205"),
    row("`uint8 fast = 1`, `uint8 None = 2`", YES, NO, "M205"),
    row("`uint8 class`, `uint8 new`", COMPILER, YES, "M205"),
    row("`uint8 maxSpeed`", NO, NO, "M201"),
    row("`uint8 a` twice", NO, NO, "M203", "uint8 a\nuint8 a\n"),
    row("`uint8 A = 1` twice", COMPILER, NO, "M203", "uint8 A = 1\nuint8 A = 1\n"),
    files("`esc_report.msg`", YES, NO, "M205", "esc_report"),
    files("`None.msg`, `DecodeError.msg`", YES, YES, "", "None", "DecodeError"),
    files("`Foo.msg` beside `FOO.msg`", YES, YES, "M205", "Foo", "FOO"),
    Row(
        "`EscReport.msg` beside `esc_report.msg`",
        NO,
        NO,
        "M204",
        {"EscReport.msg": STAMP, "esc_report.msg": f"{STAMP}# TOPICS one\n"},
    ),
    row("`float32 A = 3.4028235e38` (FLT_MAX)", COMPILER, YES, "", "float32 A = 3.4028235e38\n"),
    row("`float32 A = 1e39`", COMPILER, YES, "M305"),
    row("`float32 A = 1.`, `float32 B = .5`", YES, YES),
    row("`float32 A = nan`, `float64 B = -inf`", NO, YES),
    row("`float32 A = 1.5f`", NO, NO, "M305"),
    row("`bool A = 2`, `bool B = 0x1`", YES, NO),
    row("`bool A = true`", NO, YES),
    row("`uint8 A = 0x10`, `uint8 B = 0b1`", NO, YES),
    row("`uint8 A = 017` (17), `uint16 B = 1_000`", YES, YES, "", "uint8 A = 017\nuint16 B = 1_000\n"),
    row("`uint8 A = -1`, `char B = 'a'`", NO, NO, "M305"),
    row("a tab behind the type", NO, YES, "", "uint8\ta\n"),
    row("a space before the type", YES, NO, "", " uint8 a\n"),
    row("lines that end in CR LF", YES, YES, "M106", "uint8 a\r\n# TOPICS one\r\n"),
    row("a control character in a comment", YES, YES, "M104", "uint8 a # \x07\n"),
    row("a backslash in a comment: `uint8 a # C:\\`, `uint8 b # \\u12`", YES, NO, "M108"),
    row(
        "`*/` in the comment of a constant or a message: `uint8 A = 1 # */`",
        YES,
        COMPILER,
        "M108",
        "uint8 A = 1 # */\n",
    ),
    row(
        "brackets in the comment of a field, closed on another line",
        YES,
        NO,
        "M108",
        "uint8 a # see [one\n        # and two]\n",
    ),
    row("`#TOPICS one`, indented `# TOPICS one`", YES, YES, "M406", "#TOPICS one\n # TOPICS one\n"),
    row("`# TOPICS one  two`, a doubled space", COMPILER, YES, "M402", "# TOPICS one  two\n"),
    row("`# TOPICS from mro`", YES, YES),
    row("`# TOPICS class`", COMPILER, YES, "M205"),
    row("`# TOPICS one__two _one`", YES, YES, "M205"),
    row("`float32 MESSAGE_VERSION = 1`", YES, YES, "M405"),
    row("`uint8 ORB_QUEUE_LENGTH = 0`", YES, YES, "M405"),
    row("`uint8[0] a`", YES, NO, "M303"),
    row("`uint8 a 5`, a default value", NO, YES, "M307", "uint8 a 5\n"),
    row("`string a`, `uint8[] b`", NO, YES, "M306"),
    Row("no `uint64 timestamp`", NO, YES, "M401", {"Foo.msg": "uint32 timestamp\n"}),
]

REFUSED_ALL_THE_SAME = {"`uint8[0] a`"}
"""Definitions that PX4 builds and msggen refuses: neither ROS 2 nor DDS has an array without elements."""


def ids(each: Row) -> str:
    return each.shown


# Oracles


def cpp(spec: object, name: str) -> Iterator[str]:
    """Yield the C++ that PX4's templates generate for a message."""
    fields, constants = spec.parsed_fields(), spec.constants  # type: ignore[attr-defined]
    yield f"struct {snake_case(name)}_s {{"
    for field in fields:
        kind = field.base_type if field.is_builtin else f"{snake_case(field.base_type.split('/')[1])}_s"
        yield f"  t_{kind} {field.name}{f'[{field.array_len}]' if field.is_array else ''};"
    for constant in constants:
        yield f"  static constexpr t_{constant.type} {constant.name} = {int(constant.val)};"
    yield "};"


def ask_px4(folder: Path) -> str:
    """Return the verdict of PX4's generator, and then of a compiler, on the messages in `folder`."""
    loader = pytest.importorskip("genmsg.msg_loader", reason="needs the package pyros-genmsg")
    paths = sorted(folder.glob("*.msg"))
    source = ["#include <cstdint>", *(f"typedef {alias(name)} t_{name};" for name in sorted(SIZED))]
    if len({snake_case(path.stem) for path in paths}) != len(paths):
        return NO
    try:
        for path in paths:
            spec = loader.load_msg_from_file(loader.MsgContext.create_default(), str(path), f"px4/{path.stem}")
            kinds = {field.name: field.type for field in spec.parsed_fields()}
            if kinds.get("timestamp") != "uint64" or any(name != name.lower() for name in kinds):
                return NO
            if any(
                field.base_type not in SIZED or (field.is_array and field.array_len is None)
                for field in spec.parsed_fields()
            ):
                return NO
            source += cpp(spec, path.stem)
    except Exception:  # noqa: BLE001 - genmsg raises any exception
        return NO
    names = [topic for path in paths for topic in topics(path)]
    source.append(f"enum class ORB_ID {{ {', '.join(f'{name} = {number}' for number, name in enumerate(names))} }};")
    command = ["g++", "-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-x", "c++", "-"]
    done = subprocess.run(command, input="\n".join(source), capture_output=True, text=True, check=False)
    return COMPILER if done.returncode else YES


def alias(name: str) -> str:
    """Return the C++ type of a primitive."""
    plain = {"bool": "bool", "char": "char", "float32": "float", "float64": "double"}
    return plain.get(name, f"{name}_t")


@pytest.fixture(scope="module")
def ros() -> dict[str, str]:
    """The worst verdict of rosidl on the messages of each row."""
    definitions = [(each.shown, Path(name).stem, text) for each in ROWS for name, text in each.files.items()]
    verdicts = ask_rosidl([(name, text) for _, name, text in definitions])
    worst: dict[str, str] = {}
    for (shown, _, _), verdict in zip(definitions, verdicts, strict=True):
        worst[shown] = max(worst.get(shown, YES), verdict, key=[YES, COMPILER, NO].index)
    return worst


@pytest.mark.tools("g++")
@pytest.mark.parametrize("each", ROWS, ids=ids)
def test_px4_says_what_the_table_says(each: Row, tmp_path: Path) -> None:
    assert ask_px4(write_definitions(tmp_path, each.files)) == each.px4


@pytest.mark.parametrize("each", ROWS, ids=ids)
def test_ros_says_what_the_table_says(each: Row, ros: dict[str, str]) -> None:
    assert ros[each.shown] == each.ros


# msggen


def tree(each: Row, folder: Path) -> Path:
    """Write a firmware tree with the messages of a row."""
    return write_definitions(
        folder, {"src/modules/x": "", **{f"msg/{name}": text for name, text in each.files.items()}}
    )


def codes_of(each: Row, folder: Path) -> set[str]:
    tree(each, folder)
    try:
        return {found.code for found in catalog_of(folder, {}).notices}
    except InputError as error:
        return {found.code for found in error.diagnostics}


@pytest.mark.parametrize("each", ROWS, ids=ids)
def test_msggen_says_what_the_table_says(each: Row, tmp_path: Path) -> None:
    assert codes_of(each, tmp_path) == ({each.code} if each.code else set())


COMMANDS = {
    "build": "build -q --px4 px4 -o out",
    "check": "check --px4 px4 px4",
    "breaking": "breaking --against px4 --px4 px4",
    "sync": "sync -q --px4 px4 --create px4_msgs",
    "px4-generate": "px4-generate --headers -i px4/msg -e templates -o out -f",
}


@pytest.mark.usefixtures("working_folder")
@by_day(("each", "command"), itertools.product([each for each in ROWS if each.px4 != NO], COMMANDS), 3)
def test_what_px4_builds_is_no_error_in_any_command(
    each: Row, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A definition that only PX4's compiler refuses may be an error."""
    tree(each, Path("px4"))
    write_definitions(Path(), {"templates/msg.h.em": "@spec.full_name\n", "templates/uORBTopics.hpp.em": "x\n"})
    given = [f"px4/msg/{name}" for name in each.files] if command == "px4-generate" else []
    outcome = main([*COMMANDS[command].split(), *given])
    errors = [line for line in capsys.readouterr().err.splitlines() if " warning: " not in line]
    if each.px4 == YES and each.shown not in REFUSED_ALL_THE_SAME:
        assert (outcome, errors) == (DONE, [])
    else:
        assert outcome in (DONE, FAILED)


@pytest.mark.usefixtures("working_folder")
@pytest.mark.parametrize("each", ROWS, ids=ids)
def test_strict_refuses_what_is_warned_of(
    each: Row,
) -> None:
    tree(each, Path("px4"))
    assert main(["build", "-q", "--strict", "--px4", "px4", "-o", "out"]) == (FAILED if each.code else DONE)


# Documentation

_VERDICT = r"(yes|no|not its compiler)"
TABLE = re.compile(rf"^\| ([^|]+) \| {_VERDICT} \| {_VERDICT} \| ([^|]+) \|$", re.MULTILINE)


def test_the_page_has_the_same_table() -> None:
    found = TABLE.findall(Path(__file__).with_name("unusual.md").read_text(encoding="utf-8"))
    assert [(shown, px4, ros) for shown, px4, ros, _ in found] == [(each.shown, each.px4, each.ros) for each in ROWS]
    for each, (*_, said) in zip(ROWS, found, strict=True):
        levels = {Level.WARNING: "warning", Level.ERROR: "error"}
        expected = f"{levels[level_of(each.code)]} {each.code}" if each.code else ""
        assert said.startswith(expected) if expected else not re.search(r"\b[MSY]\d{3}\b", said)


def level_of(code: str) -> Level:
    from msggen.base.diagnostics import Diagnostic
    from msggen.base.location import Location

    assert code in CODES
    return Diagnostic(Location("x"), code, "").level
