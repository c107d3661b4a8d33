"""Tests of the reader of msg/CMakeLists.txt, with its conditions compared to those of CMake."""

from __future__ import annotations

import random
import subprocess
from itertools import product
from pathlib import Path

import pytest

from msggen.definitions.parse.cmake import is_met, parse_lists, symbols_in

UNKNOWN = "EXTERNAL_MODULES_LOCATION"


def conditions(text: str) -> dict[str, str]:
    """Return the conditions of the messages that a file lists."""
    return {name: entry.condition for name, entry in parse_lists(text, "CMakeLists.txt").listed.items()}


def test_a_list_is_read_through_comments_quotes_and_other_commands() -> None:
    lists = parse_lists(
        """
cmake_policy(SET CMP0057 NEW) # set(msg_files Wrong.msg)
#[[ set(msg_files
Wrong.msg) ]]
SET(msg_files
\tFirst.msg # Wrong.msg
\t"Second.msg"
\t[=[Third.msg]=]
\t${CMAKE_CURRENT_SOURCE_DIR}/versioned/Fourth.msg
)
list(SORT msg_files)
px4_list_make_absolute(msg_files ${CMAKE_CURRENT_SOURCE_DIR} ${msg_files})
set(msg_files ${msg_files} PARENT_SCOPE)
function(other)
\tlist(APPEND msg_files Wrong.msg)
endfunction()
foreach(file ${msg_files})
\tlist(APPEND headers ${file}.h)
endforeach()
add_custom_command(OUTPUT a COMMAND b "(" -f ${msg_files})
""",
        "CMakeLists.txt",
    )
    assert list(lists.listed) == ["First.msg", "Second.msg", "Third.msg", "versioned/Fourth.msg"]
    assert lists.complete
    assert not any(entry.condition for entry in lists.listed.values())
    assert [str(entry.location) for entry in lists.listed.values()][:2] == ["CMakeLists.txt:6:2", "CMakeLists.txt:7:3"]


def test_branches_give_conditions() -> None:
    assert conditions(
        """
set(msg_files Always.msg)
if(CONFIG_A)
    list(APPEND msg_files A.msg)
    if(NOT CONFIG_B)
        list(APPEND msg_files AnotB.msg)
    endif()
elseif(CONFIG_B OR CONFIG_C)
    list(PREPEND msg_files BorC.msg)
else()
    list(INSERT msg_files 0 Neither.msg)
endif(CONFIG_A)
list(APPEND msg_files Last.msg)
"""
    ) == {
        "Always.msg": "",
        "A.msg": "CONFIG_A",
        "AnotB.msg": "CONFIG_A AND (NOT CONFIG_B)",
        "BorC.msg": "(NOT CONFIG_A) AND (CONFIG_B OR CONFIG_C)",
        "Neither.msg": "(NOT CONFIG_A) AND (NOT (CONFIG_B OR CONFIG_C))",
        "Last.msg": "",
    }


def test_lists_of_other_variables_and_removals_count() -> None:
    assert conditions(
        """
set(mine Mine.msg Other.msg)
if(CONFIG_A)
    list(APPEND mine Sometimes.msg)
endif()
set(msg_files One.msg Two.msg ${mine})
set(msg_files ${msg_files} Three.msg)
list(REMOVE_ITEM msg_files Two.msg)
if(CONFIG_SMALL)
    list(REMOVE_ITEM msg_files Other.msg)
else()
    list(APPEND msg_files Sometimes.msg)
endif()
"""
    ) == {
        "One.msg": "",
        "Mine.msg": "",
        "Other.msg": "NOT CONFIG_SMALL",
        "Three.msg": "",
        "Sometimes.msg": "CONFIG_A OR (NOT CONFIG_SMALL)",
    }


def test_what_is_not_understood_stays_as_text() -> None:
    found = conditions('set(msg_files A.msg)\nif(NOT (X STREQUAL "a b") AND EXISTS ${Y})\nlist(APPEND msg_files B.msg)')
    assert found == {"A.msg": "", "B.msg": 'NOT (X STREQUAL "a b") AND EXISTS ${Y}'}
    assert is_met(found["B.msg"], lambda _: True) is None


BROKEN = (
    *("", "set(", "set()", "if(", "endif()", "else()", ")))", '"', "#[[", "[[", "\\", "list()", "list(APPEND)"),
    *("set(msg_files", "list(REMOVE_ITEM)", "set(msg_files \\", "\0set(\0)"),
)


@pytest.mark.parametrize("text", BROKEN)
def test_broken_files_list_nothing_and_raise_nothing(text: str) -> None:
    assert not parse_lists(text, "CMakeLists.txt").complete


def test_lists_are_not_complete_where_files_are_found_by_a_pattern() -> None:
    assert not parse_lists("set(msg_files A.msg)\nfile(GLOB found *.msg)\n", "").complete
    assert not parse_lists("if(CONFIG_A)\nset(msg_files A.msg)\nendif()", "").complete
    assert not parse_lists("set(other_files A.msg)", "").complete


def test_deep_nesting_is_no_trouble() -> None:
    deep = "(" * 50_000 + "CONFIG_A" + ")" * 50_000
    assert is_met(deep, {"A": True}.get) is True
    text = "if(CONFIG_A)\n" * 300 + "list(APPEND msg_files A.msg)\n"
    assert conditions(text) == {"A.msg": "CONFIG_A"}


def test_a_condition_that_depends_on_nothing_unknown_is_decided() -> None:
    def value(condition: str) -> bool | None:
        return is_met(condition, {"A": True, "B": False}.get)

    assert value("") is True
    assert value("CONFIG_A") is True
    assert value("${CONFIG_B}") is False
    assert value(f"CONFIG_A OR {UNKNOWN}") is True
    assert value(f"CONFIG_B AND {UNKNOWN}") is False
    assert value(f"CONFIG_A AND {UNKNOWN}") is None
    assert value(f"NOT {UNKNOWN}") is None
    assert value("CONFIG_MISSING") is None
    for broken in ("AND", "NOT", "(", ")", "CONFIG_A AND", "CONFIG_A (CONFIG_B)", "()", "CONFIG_A NOT CONFIG_B"):
        assert value(broken) is None, broken
    assert symbols_in('CONFIG_A AND (${CONFIG_B} OR X STREQUAL "CONFIG_A")') == ("A", "B")


@pytest.mark.tools("cmake")
def test_cmake_agrees_on_random_conditions(tmp_path: Path) -> None:
    choose = random.Random(5)  # noqa: S311 - not used for security
    texts = [_expression(choose, 4) for _ in range(150)]
    expected = []
    script = ["cmake_minimum_required(VERSION 3.10)"]
    for values in product((True, False), repeat=3):
        known = dict(zip("ABC", values, strict=True))
        script += [f'set(CONFIG_{name} "{"y" if value else ""}")' for name, value in known.items()]
        script += [f"if({text})\nmessage(yes)\nelse()\nmessage(no)\nendif()" for text in texts]
        expected += ["yes" if is_met(text, known.get) else "no" for text in texts]
    path = tmp_path / "script.cmake"
    path.write_text("\n".join(script), encoding="utf-8")
    done = subprocess.run(["cmake", "-P", str(path)], check=True, capture_output=True, text=True)
    assert done.stderr.split() == expected
    assert len(set(expected)) == 2


def _expression(choose: random.Random, depth: int) -> str:
    kind = choose.randrange(4) if depth else 0
    if kind == 0:
        return f"CONFIG_{choose.choice('ABC')}"
    if kind == 1:
        return f"NOT {_expression(choose, 0)}"
    if kind == 2:
        return f"({_expression(choose, depth - 1)})"
    return f"{_expression(choose, depth - 1)} {choose.choice(['AND', 'OR'])} {_expression(choose, depth - 1)}"
