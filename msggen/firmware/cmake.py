"""`msg/CMakeLists.txt` of the firmware: which messages its lists name, and under which conditions.

Only what makes the list of messages is followed: `set`, `list` and `if` with what they nest. Everything else in the
file is passed over, and a condition that is not understood is kept as text.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from msggen.firmware.expression import CMAKE, Truth, evaluate
from msggen.location import Location

LIST = "msg_files"
"""The variable that the firmware's build reads."""

_FALSE = ("", "0", "OFF", "NO", "N", "FALSE", "IGNORE", "NOTFOUND")
_TRUE = ("1", "ON", "YES", "Y", "TRUE")
_HERE = "${CMAKE_CURRENT_SOURCE_DIR}/"
_REFERENCE = re.compile(r"\$\{(\w+)\}")
_SYMBOL = re.compile(r"(?:\$\{)?CONFIG_(\w+)\}?")
_SCOPED = ("PARENT_SCOPE", "CACHE")
_OPENS, _CLOSES = ("function", "macro"), ("endfunction", "endmacro")
_WORD = re.compile(r'"[^"]*"|[()]|[^\s()"]+')
_TOKEN = re.compile(
    r"""
      \s+
    | \#\[(?P<mark>=*)\[ .*? (?:\](?P=mark)\]|\Z)                     # a comment in brackets
    | \# [^\n]*
    | \[(?P<fence>=*)\[ (?P<bracketed>.*?) (?:\](?P=fence)\]|\Z)
    | " (?P<quoted>(?:[^"\\]|\\.)*) (?:"|\Z)
    | (?P<parenthesis>[()])
    | (?P<plain>(?:[^\s()\#"\\;]|\\.)+)
    | .                                                                 # a lone `;` or backslash
    """,
    re.VERBOSE | re.DOTALL,
)


class Listed(NamedTuple):
    """A message that the list names: the condition, "" for none, and the place where it is named."""

    condition: str
    location: Location


class MessageLists(NamedTuple):
    """The messages by their file below `msg/`, such as `versioned/VehicleStatus.msg`.

    The lists are `complete` where they name messages without a condition, and no file is found by a pattern.
    """

    listed: Mapping[str, Listed]
    complete: bool


def parse_lists(text: str, path: str) -> MessageLists:
    """Return what the CMakeLists.txt in `text` lists. Never raises: what is not understood lists nothing."""
    reader = _Reader(path)
    for command in _commands(text):
        reader.follow(command)
    listed = {name: entry for name, entry in reader.variables.get(LIST, {}).items() if name.endswith(".msg")}
    complete = not reader.has_patterns and any(not entry.condition for entry in listed.values())
    return MessageLists(listed, complete)


def symbols_in(condition: str) -> tuple[str, ...]:
    """Return the symbols of Kconfig that a condition asks for, without `CONFIG_`."""
    return tuple(dict.fromkeys(_SYMBOL.findall(condition)))


def is_met(condition: str, value_of: Callable[[str], Truth]) -> Truth:
    """Return whether a condition holds where `value_of` knows the symbols of Kconfig; None where that is unknown."""

    def holds(operand: Sequence[str]) -> Truth:
        if len(operand) > 1:
            return None
        symbol = _SYMBOL.fullmatch(operand[0])
        if symbol:
            return value_of(symbol[1])
        constant = operand[0].strip('"').upper()
        return False if is_false(constant) else True if constant in _TRUE else None

    return evaluate(_WORD.findall(condition), CMAKE, holds) if condition else True


def is_false(value: str) -> bool:
    """Whether CMake takes the value of a variable for false."""
    return value.upper() in _FALSE or value.upper().endswith("-NOTFOUND")


class _Word(NamedTuple):
    text: str
    location: Location
    is_quoted: bool = False

    @property
    def source(self) -> str:
        """The word as it was written."""
        return f'"{self.text}"' if self.is_quoted else self.text


class _Command(NamedTuple):
    name: str
    words: tuple[_Word, ...]


class _Reader:
    """Follows commands: which files each variable has, and under which condition."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.variables: dict[str, dict[str, Listed]] = {}
        self.has_patterns = False
        self._branches: list[tuple[str, str]] = []
        """For each open `if`: that no earlier branch was taken, and that this one is."""
        self._functions = 0

    @property
    def condition(self) -> str:
        """The condition of what stands here."""
        return _all(part for branch in self._branches for part in branch)

    def follow(self, command: _Command) -> None:
        name, words = command
        if name in _OPENS or name in _CLOSES:
            self._functions = max(0, self._functions + (1 if name in _OPENS else -1))
        elif self._functions:
            return
        elif name == "if":
            self._branches.append(("", _condition(words)))
        elif name in ("elseif", "else") and self._branches:
            before, last = self._branches[-1]
            self._branches[-1] = (_all((before, _not(last))), _condition(words) if name == "elseif" else "")
        elif name == "endif" and self._branches:
            self._branches.pop()
        elif name in ("set", "list", "file") and words:
            self._change(name, words)

    def _change(self, command: str, words: tuple[_Word, ...]) -> None:
        texts = [word.text for word in words]
        if command == "set" and not any(scope in texts for scope in _SCOPED):
            if f"${{{texts[0]}}}" not in texts:
                self._remove(texts[0], None)
            self._add(texts[0], [word for word in words[1:] if word.text != f"${{{texts[0]}}}"])
        elif command == "list" and texts[0] in ("APPEND", "PREPEND", "INSERT") and texts[1:]:
            self._add(texts[1], words[2:])
        elif command == "list" and texts[0] == "REMOVE_ITEM" and texts[1:]:
            self._remove(texts[1], self._files(words[2:]))
        elif command == "file" and texts[0] in ("GLOB", "GLOB_RECURSE") and any(".msg" in text for text in texts):
            self.has_patterns = True

    def _add(self, variable: str, words: Sequence[_Word]) -> None:
        known = self.variables.setdefault(variable, {})
        for name, entry in self._files(words).items():
            other = known.get(name, entry)
            known[name] = other._replace(condition=_any(other.condition, entry.condition))

    def _remove(self, variable: str, names: Mapping[str, Listed] | None) -> None:
        """Remove files from a variable, all of them without `names`, where the condition of this place holds."""
        known = self.variables.get(variable, {})
        for name in [name for name in known if names is None or name in names]:
            entry = known.pop(name)
            if self.condition:
                known[name] = entry._replace(condition=_all((entry.condition, _not(self.condition))))

    def _files(self, words: Sequence[_Word]) -> dict[str, Listed]:
        """Return the files that `words` name, those of variables included."""
        found: dict[str, Listed] = {}
        for word in words:
            variable = _REFERENCE.fullmatch(word.text)
            for name, entry in self.variables.get(variable[1], {}).items() if variable else ():
                found[name] = entry._replace(condition=_all((entry.condition, self.condition)))
            for name in word.text.split(";"):
                file = posixpath.normpath(name.removeprefix(_HERE))
                if "$" not in file:
                    found[file] = Listed(self.condition, word.location._replace(path=self.path))
        return found


def _commands(text: str) -> Iterator[_Command]:
    """Yield the commands of a file; the parentheses inside their arguments are words."""
    name = ""
    words: list[_Word] = []
    depth = 0
    line, counted_to, line_start = 1, 0, 0
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        if kind in (None, "mark"):
            continue
        skipped = text.count("\n", counted_to, token.start())
        if skipped:
            line, line_start = line + skipped, text.rfind("\n", 0, token.start()) + 1
        counted_to = token.start()
        word = _Word(token[kind or 0], Location("", line, token.start() - line_start + 1), kind == "quoted")
        if kind == "parenthesis":
            depth = max(0, depth + (1 if word.text == "(" else -1))
            if (word.text, depth) == ("(", 1):
                words = []
                continue
            if (word.text, depth) == (")", 0):
                yield _Command(name.lower(), tuple(words))
                name = ""
                continue
        if depth:
            words.append(word)
        else:
            name = word.text


def _condition(words: Sequence[_Word]) -> str:
    return " ".join(word.source for word in words).replace("( ", "(").replace(" )", ")")


def _all(conditions: Iterator[str] | Sequence[str]) -> str:
    """Return a condition that holds where all do."""
    parts = list(dict.fromkeys(filter(None, conditions)))
    return parts[0] if len(parts) == 1 else " AND ".join(map(_in_parentheses, parts))


def _any(left: str, right: str) -> str:
    """Return a condition that holds where either does."""
    if not left or not right or left == right:
        return left and right
    return f"{_in_parentheses(left)} OR {_in_parentheses(right)}"


def _not(condition: str) -> str:
    return f"NOT {_in_parentheses(condition)}"


def _in_parentheses(condition: str) -> str:
    return f"({condition})" if " " in condition else condition
