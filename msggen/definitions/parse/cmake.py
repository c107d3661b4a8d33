"""The parser of the firmware's `msg/CMakeLists.txt`: the messages that it lists, with their conditions.

Only the commands that build the list of messages are followed: `set`, `list`, and `if` with its branches. All other
commands are skipped. A condition that is not understood is kept as text.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from msggen.base.location import Location, Places
from msggen.definitions.parse.expression import CMAKE, Truth, evaluate

LIST = "msg_files"
"""The variable with the list of messages that the firmware's build reads."""

_FALSE = ("", "0", "OFF", "NO", "N", "FALSE", "IGNORE", "NOTFOUND")
_TRUE = ("1", "ON", "YES", "Y", "TRUE")
_HERE = "${CMAKE_CURRENT_SOURCE_DIR}/"
_REFERENCE = re.compile(r"\$\{(\w+)\}")
_SYMBOL = re.compile(r"(?:\$\{)?CONFIG_(\w+)\}?")
_SCOPED = ("PARENT_SCOPE", "CACHE")
_OPENS, _CLOSES = ("function", "macro"), ("endfunction", "endmacro")
_FOLLOWED = (*_OPENS, *_CLOSES, "if", "elseif", "else", "endif", "set", "list", "file")
_SIMPLE = re.compile(r'[^()"#\[\]\\]*\)')
"""The rest of a simple command up to its closing parenthesis, without quotes, brackets, comments or backslashes."""
_WORD = re.compile(r'"[^"]*"|[()]|[^\s()"]+')
_TOKEN = re.compile(
    r"""
    \s* (?:
        (?P<plain>(?:[^\s()\#"\\;\[]|\\.)(?:[^\s()\#"\\;]|\\.)*)
      | (?P<parenthesis>[()])
      | \#\[(?P<mark>=*)\[ .*? (?:\](?P=mark)\]|\Z)               # a comment in brackets
      | \# [^\n]*
      | \[(?P<fence>=*)\[ (?P<bracketed>.*?) (?:\](?P=fence)\]|\Z)
      | " (?P<quoted>(?:[^"\\]|\\.)*) (?:"|\Z)
      | .                                                         # a lone `;`, `[` or backslash
    )
    """,
    re.VERBOSE | re.DOTALL,
)


_DEEPEST = 64
"""Maximum number of conditions that hold together."""

_LONGEST = 2000
"""Maximum length of a condition. A longer one is unknown."""

_LONG = "..."
"""A condition that is too long. It is neither true nor false."""

_MOST_WORK = 20_000
"""Maximum number of files in all copies of variables. The firmware has some hundreds."""


class _TooMuchError(Exception):
    """An error: the commands copy too many files."""


class Listed(NamedTuple):
    """A message in the list: its condition, "" for none, and its location."""

    condition: str
    location: Location


class MessageLists(NamedTuple):
    """The listed messages by their file below `msg/`, such as `versioned/VehicleStatus.msg`.

    The lists are `complete` if at least one message has no condition, and no files are found by a pattern.
    """

    listed: Mapping[str, Listed]
    complete: bool


def parse_lists(text: str, path: str) -> MessageLists:
    """Return the messages that the CMakeLists.txt in `text` lists. Never raises: unknown commands are skipped.

    Nothing is listed if copies of variables have too many files in all.
    """
    reader = _Reader()
    try:
        for name, words in _commands(text):
            reader.follow(name, words)
    except _TooMuchError:
        return MessageLists({}, complete=False)
    found = {name: entry for name, entry in reader.variables.get(LIST, {}).items() if name.endswith(".msg")}
    complete = not reader.has_patterns and any(not entry.condition for entry in found.values())
    places = Places(text, path)
    listed = {name: Listed(condition, places.at(start)) for name, (condition, start) in found.items()}
    return MessageLists(listed, complete)


def symbols_in(condition: str) -> tuple[str, ...]:
    """Return the Kconfig symbols in a condition, without `CONFIG_`."""
    return tuple(dict.fromkeys(_SYMBOL.findall(condition)))


def is_met(condition: str, value_of: Callable[[str], Truth]) -> Truth:
    """Return whether a condition holds, None if that is unknown. `value_of` returns the value of a Kconfig symbol."""

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
    """Return whether CMake treats the value of a variable as false."""
    return value.upper() in _FALSE or value.upper().endswith("-NOTFOUND")


class _Word(NamedTuple):
    text: str
    start: int
    is_quoted: bool

    @property
    def source(self) -> str:
        """The word as it is written in the file."""
        return f'"{self.text}"' if self.is_quoted else self.text


class _Entry(NamedTuple):
    """A file in a variable: its condition, and the position of its name in the text."""

    condition: str
    start: int


class _Reader:
    """An interpreter of commands that collects the files in each variable, with their conditions."""

    def __init__(self) -> None:
        self.variables: dict[str, dict[str, _Entry]] = {}
        self.has_patterns = False
        self._branches: list[tuple[str, str]] = []
        """For each open `if`, two conditions: no earlier branch is taken, and the current branch is taken."""
        self._open: dict[str, int] = {}
        """The number of branches with each condition."""
        self._functions = 0
        self._work = 0

    @property
    def condition(self) -> str:
        """The condition of the current command."""
        return _all([*self._open]) if len(self._open) <= _DEEPEST else _LONG

    def follow(self, name: str, words: Sequence[_Word]) -> None:
        """Apply one command to the variables and branches."""
        if name in _OPENS or name in _CLOSES:
            self._functions = max(0, self._functions + (1 if name in _OPENS else -1))
        elif self._functions:
            return
        elif name == "if":
            self._enter("", _condition(words))
        elif name in ("elseif", "else") and self._branches:
            before, last = self._leave()
            self._enter(_all((before, _not(last))), _condition(words) if name == "elseif" else "")
        elif name == "endif" and self._branches:
            self._leave()
        elif name in ("set", "list", "file") and words:
            self._change(name, words)

    def _enter(self, before: str, taken: str) -> None:
        self._branches.append((before, taken))
        for part in filter(None, (before, taken)):
            self._open[part] = self._open.get(part, 0) + 1

    def _leave(self) -> tuple[str, str]:
        branch = self._branches.pop()
        for part in filter(None, branch):
            self._open[part] -= 1
            if not self._open[part]:
                del self._open[part]
        return branch

    def _change(self, command: str, words: Sequence[_Word]) -> None:
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
            other = known.get(name)
            known[name] = _Entry(_any(other.condition, entry.condition), other.start) if other else entry

    def _remove(self, variable: str, names: Mapping[str, _Entry] | None) -> None:
        """Remove files from a variable if the condition of the current command holds; all files if `names` is None."""
        known = self.variables.get(variable, {})
        condition = self.condition
        for name in [*known] if names is None else [name for name in names if name in known]:
            self._count()
            entry = known.pop(name)
            if condition:
                known[name] = entry._replace(condition=_all((entry.condition, _not(condition))))

    def _count(self) -> None:
        self._work += 1
        if self._work > _MOST_WORK:
            raise _TooMuchError

    def _files(self, words: Sequence[_Word]) -> dict[str, _Entry]:
        """Return the files that `words` name, including those in variables."""
        found: dict[str, _Entry] = {}
        condition = self.condition
        for text, start, _ in words:
            if "$" not in text and ";" not in text and "./" not in text:
                found[text] = _Entry(condition, start)
                continue
            variable = _REFERENCE.fullmatch(text)
            for name, entry in self.variables.get(variable[1], {}).items() if variable else ():
                self._count()
                found[name] = entry._replace(condition=_all((entry.condition, condition)))
            files = (posixpath.normpath(name.removeprefix(_HERE)) for name in text.split(";"))
            found |= {file: _Entry(condition, start) for file in files if "$" not in file}
        return found


def _commands(text: str) -> Iterator[tuple[str, list[_Word]]]:
    """Yield the name in lower case and the words of each command that is followed.

    Parentheses inside the arguments are words too.
    """
    name = ""
    words: list[_Word] = []
    depth = position = 0
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            return
        position = token.end()
        kind = token.lastgroup
        if kind is None or kind == "mark":
            continue
        word = _Word(token[kind], token.start(kind), is_quoted=kind == "quoted")
        if not depth and kind != "parenthesis":
            name = word.text.lower()
            continue
        if kind == "parenthesis":
            depth = max(0, depth + (1 if word.text == "(" else -1))
            if word.text == "(" and depth == 1:
                words = []
                rest = None if name in _FOLLOWED else _SIMPLE.match(text, position)
                if rest:
                    depth, position = 0, rest.end()
                continue
            if not depth:
                if name in _FOLLOWED:
                    yield name, words
                name = ""
                continue
        words.append(word)


def _condition(words: Sequence[_Word]) -> str:
    return _bounded(" ".join(word.source for word in words).replace("( ", "(").replace(" )", ")"))


def _bounded(condition: str) -> str:
    return condition if len(condition) <= _LONGEST else _LONG


def _all(conditions: Sequence[str]) -> str:
    """Return a condition that holds if all of `conditions` hold."""
    parts = list(dict.fromkeys(filter(None, conditions)))
    return parts[0] if len(parts) == 1 else _bounded(" AND ".join(map(_in_parentheses, parts)))


def _any(left: str, right: str) -> str:
    """Return a condition that holds if either condition holds."""
    if not left or not right or left == right:
        return left and right
    return _bounded(f"{_in_parentheses(left)} OR {_in_parentheses(right)}")


def _not(condition: str) -> str:
    return _bounded(f"NOT {_in_parentheses(condition)}")


def _in_parentheses(condition: str) -> str:
    return f"({condition})" if " " in condition else condition
