"""The enums of the firmware's trees, and the rules by which constants become one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen import read
from msggen.definitions.enumeration import (
    MOST_MEMBERS,
    Enumeration,
    constant_prefixes,
    enum_by_name,
    enumerations,
    integer_constants,
)
from msggen.definitions.model import Catalog, Message
from msggen.definitions.parse.definition import parse_message
from msggen.generate.python.names import enum_names
from support.repository import shared
from support.slow_enums import SlowEnum, slow_enums, slow_prefixes

LIST = Path(__file__).with_name("enums.txt")
"""Every enum and every other integer constant of the trees. This module writes it if it is run as a program."""

TREES = ("v1.14", "v1.15", "v1.16", "v1.17", "v1.18", "main-2026-03")


def lines_of(catalog: Catalog) -> Iterator[str]:
    """Yield a line for each enum and for the other constants of each message."""
    halves = [half for service in catalog.services for half in (service.request, service.response)]
    for message in (*catalog.messages.values(), *halves):
        used = set()
        for enum in enumerations(message):
            used |= {member.constant.name for member in enum.members}
            kind = "bit numbers" if enum.has_bit_numbers else "flags" if enum.is_flags else "values"
            members = " ".join(f"{member.name}={member.value}" for member in enum.members)
            yield f"{message.name}.{enum.name}, {kind} of {users(message, enum)}: {members}"
        rest = [constant.name for constant in integer_constants(message) if constant.name not in used]
        if rest:
            yield f"{message.name}, no enum: {' '.join(rest)}"


def users(message: Message, enum: Enumeration) -> str:
    """Return the fields of an enum with the origin of each tag, without the release."""
    origins = {field.name: field.comment.origin("enum").partition(" ")[0] for field in message.fields}
    return " ".join(f"{field} ({origins[field]})" for field in enum.fields) or "parameters"


def the_list() -> str:
    """Return the lines of all trees, each with the trees that have it."""
    found: dict[str, list[str]] = {}
    for tree in TREES:
        for line in lines_of(read(shared(f"firmware/{tree}"))):
            found.setdefault(line, []).append(tree)
    return "".join(f"{line} [{', '.join(trees)}]\n" for line, trees in sorted(found.items()))


def test_every_enum_of_the_trees_is_listed() -> None:
    assert the_list() == LIST.read_text()


def enum_of(*lines: str) -> Enumeration | None:
    """Return the only enum of a definition."""
    message = parse_message("\n".join(["uint64 timestamp", *lines, ""]), "A.msg", "A", "p")[0]
    found = enumerations(message)
    assert len(found) <= 1
    return found[0] if found else None


def members(enum: Enumeration | None) -> dict[str, int]:
    """Return the values of the members by name."""
    return {member.name: member.value for member in enum.members} if enum else {}


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["uint8 s # [@enum A]", "uint8 A_X = 0", "uint8 A_Y = 7", "uint8 B_X = 1"], {"X": 0, "Y": 7}),
        (["uint8 s # [@enum A B]", "uint8 A_X = 0", "uint8 B_X = 1"], {"A_X": 0, "B_X": 1}),
        (["uint8 s # [@enum VTE_A]", "uint8 A_X = 0", "uint8 A_Y = 1"], {"X": 0, "Y": 1}),
        (["uint8 s # [@enum A]", "uint8 A_2D = 0"], {"A_2D": 0}),
        (["uint8 s # [@enum A]", "uint8 A_X = 0", "uint8 A_Y = 1", "uint8 A_MAX = 2"], {"X": 0, "Y": 1}),
        (["uint8 s # [@enum A]", "uint8 A_X = 0", "uint8 A_MAX = 100"], {"X": 0, "MAX": 100}),
        (["uint8 s # [@enum A]", "uint8 A_X = 0", "uint8 A_COUNT = 9"], {"X": 0}),
        (["uint8 s # [@enum A]", "float32 A_X = 0"], {}),
        (["float32 s # [@enum A]", "uint8 A_X = 0"], {}),
        (["uint8 s # [@enum A]", "uint8 B_X = 0"], {}),
    ],
)
def test_members(lines: list[str], expected: dict[str, int]) -> None:
    assert members(enum_of(*lines)) == expected


@pytest.mark.parametrize(
    ("tag", "name"),
    [
        ("A_B", "AB"),
        ("1_A", "A"),
        ("\ufb01_A", "A"),
        ("A [x", "A"),
        ("NONE_A", "NoneA"),
        ("\u0660_A", "A"),
        ("A,A", "AA"),
    ],
)
def test_the_name_is_one_that_python_can_have(tag: str, name: str) -> None:
    enum = enum_of(f"uint8 s # [@enum {tag}]", "uint8 A_X = 0", "uint8 A_B_Y = 1")
    assert enum
    assert enum.name == name or (enum.name.isascii() and enum.name.isidentifier())


def test_a_constant_belongs_to_the_longest_prefix() -> None:
    lines = ["uint8 a # [@enum A]", "uint8 b # [@enum A_B]", "uint8 A_X = 0", "uint8 A_B_Y = 1"]
    message = parse_message("\n".join(["uint64 timestamp", *lines, ""]), "A.msg", "A", "p")[0]
    assert [members(enum) for enum in enumerations(message)] == [{"X": 0}, {"Y": 1}]


@pytest.mark.parametrize(
    ("field", "values", "expected"),
    [
        ("uint8 s # [@enum A]", {"X": 1, "Y": 2}, "values"),
        ("uint8 s # [@enum A] Bitmask.", {"X": 1, "Y": 2}, "flags"),
        ("uint8 s_flags # [@enum A]", {"X": 1, "Y": 2}, "flags"),
        ("uint8 s # [@enum A] Bitmask.", {"NONE": 0, "X": 1, "Y": 2}, "flags"),
        ("uint8 s # [@enum A] Bitmask.", {"X": 0, "Y": 1, "Z": 2}, "numbers"),
        ("uint8 s # [@enum A] Bitmask.", {"X": 0, "Y": 1, "Z": 2, "W": 3}, "numbers"),
        ("uint8 s # [@enum A] Bitmask.", {"X": 0, "Y": 8}, "values"),
        ("uint8 s # [@enum A] Bitmask.", {"X": 3, "Y": 9}, "values"),
        ("uint8 s # [@enum A]", {"X": 1, "Y": 2, "Z": 4, "W": 8}, "flags"),
        ("uint8 s # [@enum A]", {"X": 1, "Y": 2, "Z": 4, "W": 7}, "values"),
    ],
)
def test_flags(field: str, values: dict[str, int], expected: str) -> None:
    enum = enum_of(field, *(f"uint8 A_{name} = {value}" for name, value in values.items()))
    assert enum
    assert ("numbers" if enum.has_bit_numbers else "flags" if enum.is_flags else "values") == expected


@pytest.mark.parametrize(
    ("field", "values", "is_enum"),
    [
        ("uint8 state", {"STATE_A": 0, "STATE_B": 1}, True),
        ("int8 state", {"STATE_A": -1, "STATE_B": 0, "STATE_C": 1}, True),
        ("uint8 state", {"STATE_A": 1, "STATE_B": 2, "STATE_C": 3}, True),
        ("uint16 state", {"STATE_A": 1, "STATE_B": 2, "STATE_C": 4, "STATE_D": 8}, True),
        ("uint8 state", {"STATE_A": 0}, False),
        ("uint8 state", {"STATE_MIN": 0, "STATE_DEFAULT": 20, "STATE_FULL": 100}, False),
        ("uint8 state", {"STATE_MOTOR1": 101, "STATE_SERVO1": 201}, False),
        ("uint8[4] state", {"STATE_A": 0, "STATE_B": 1}, False),
        ("float32 state", {"STATE_A": 0, "STATE_B": 1}, False),
        ("uint8 state", {"STATES_A": 0, "STATES_B": 1}, False),
        ("int8 state", {"STATE_A": 0, "STATE_B": 1, **{f"STATE_{n}": n for n in range(2, 129)}}, False),
    ],
)
def test_a_name_is_an_enum_only_without_doubt(
    tmp_path: Path,
    field: str,
    values: dict[str, int],
    is_enum: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    constants = "".join(
        f"uint16 {name} = {value}\n" if value >= 0 else f"int8 {name} = {value}\n" for name, value in values.items()
    )
    (tmp_path / "Lamp.msg").write_text(f"uint64 timestamp\n{field}\n{constants}")
    (message,) = read(tmp_path).messages.values()
    assert bool(enumerations(message)) is is_enum
    if is_enum:
        assert message.fields[1].comment.origin("enum") == "name"


WORDS = st.sampled_from(["A", "B", "C", "MAX", "COUNT", "END"])
NAMES = st.lists(WORDS, min_size=1, max_size=4).map("_".join)


@given(
    st.lists(st.tuples(NAMES, st.integers(0, 5)), max_size=12, unique_by=lambda each: each[0]),
    st.lists(st.lists(NAMES, min_size=1, max_size=3).map(" ".join), max_size=6),
)
def test_enums_are_those_of_a_look_at_every_constant(constants: list[tuple[str, int]], tags: list[str]) -> None:
    lines = [f"uint8 {name} = {value}" for name, value in constants]
    lines += [f"uint8 x{number} # [@enum {tag}]" for number, tag in enumerate(tags)]
    message = definition_of(lines)
    found = [
        SlowEnum(enum.tag, enum.prefixes, tuple(member.constant.name for member in enum.members))
        for enum in enumerations(message)
    ]
    assert found == list(slow_enums(message))
    integers = [constant.name for constant in integer_constants(message)]
    for tag in tags:
        assert constant_prefixes(message, tag) == slow_prefixes(tag, integers)


def definition_of(lines: Iterable[str]) -> Message:
    """Return a message of these lines."""
    return parse_message("\n".join(["uint64 timestamp", *lines, ""]), "A.msg", "A", "p")[0]


MANY = 4000


@pytest.mark.parametrize("tag", [" # [@enum A{}]", ""])
def test_many_enums_are_found(tag: str) -> None:
    runner = pytest.importorskip("fuzz.runner")
    lines = [f"uint8 A{number}_B = 1" for number in range(MANY)]
    lines += [f"uint8 a{number}{tag.format(number)}" for number in range(MANY)]
    message = definition_of(lines)
    with runner.limited():
        named = [enum_by_name(message, field) for field in message.fields]
        found = enumerations(message)
        assert len({*enum_names(found, ()).values()}) == len(found) == (MANY if tag else 0)
    assert not any(named)


def test_an_enum_can_have_many_constants() -> None:
    runner = pytest.importorskip("fuzz.runner")
    lines = [f"uint16 A_{number} = {number}" for number in range(2 * MANY)]
    message = definition_of([*lines, "uint16 x # [@enum A]"])
    with runner.limited():
        (found,) = enumerations(message)
    assert len(found.members) == 2 * MANY


@pytest.mark.parametrize("tag", ["X{}_A", "A B{}"])
def test_enums_cannot_multiply_constants(tag: str) -> None:
    """Each of many tags names all constants: the first enums have them, and the last one with its own few, too."""
    runner = pytest.importorskip("fuzz.runner")
    lines = [f"uint16 A_{number} = {number}" for number in range(MANY)]
    lines += [f"uint16 B{number}_C = 1" for number in range(MANY)]
    lines += [f"uint16 x{number} # [@enum {tag.format(number)}]" for number in range(MANY)]
    message = definition_of([*lines, "uint16 D_OFF = 0", "uint16 D_ON = 1", "uint16 d # [@enum D]"])
    with runner.limited():
        found = enumerations(message)
    assert sum(len(each.members) for each in found) <= MOST_MEMBERS
    assert len(found) == MOST_MEMBERS // (MANY + tag.count("B")) + 1
    assert [member.name for member in found[-1].members] == ["OFF", "ON"]


def test_a_tag_can_have_many_words() -> None:
    runner = pytest.importorskip("fuzz.runner")
    message = definition_of(f"uint8 B{number} = 1" for number in range(MANY))
    with runner.limited():
        assert constant_prefixes(message, "_".join("a" * MANY)) == ()


if __name__ == "__main__":
    LIST.write_text(the_list())
