"""The parser of Kconfig files, and the values of symbols in a board's configuration.

A symbol has the value that the configuration assigns, or else its default. It is off if its dependencies do not hold.
`select`, choices and conditions of prompts are ignored.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple, Protocol

from msggen.definitions.parse.cmake import is_false
from msggen.definitions.parse.expression import KCONFIG, Truth, both, evaluate, negated

_ROOT = "Kconfig"
_MAX_DEPTH = 64
_MOST = 64
"""Maximum number of conditions and of defaults of a symbol."""

_UNKNOWN = "( )"
"""An expression whose value is unknown."""

_ASSIGNED = re.compile(r"^[ \t]*CONFIG_(\w+)=(.*)|^# CONFIG_(\w+) is not set", re.MULTILINE)
_WORD = re.compile(r'&&|\|\||!=|[<>]=|[()!=<>]|"[^"]*"|[^\s()!=<>&|"]+')
_OPENS, _CLOSES = ("menu", "choice", "if"), ("endmenu", "endchoice", "endif")
_SOURCES = ("source", "rsource", "osource", "orsource")
_HELP = ("help", "---help---")
_DEFAULTS = ("default", "def_bool", "def_tristate")


class Files(Protocol):
    """The files of a tree, by their names in it."""

    def is_file(self, name: str) -> bool:
        """Return whether the file exists."""

    def names(self, folder: str) -> Sequence[str]:
        """Return the names in a folder, whose name ends in `/`."""

    def read(self, name: str) -> bytes:
        """Return the contents of a file."""


class Definition(NamedTuple):
    """A definition of a symbol in the file `name`: its defaults with their conditions, and its dependencies."""

    name: str
    defaults: tuple[tuple[str, str], ...] = ()
    depends: tuple[str, ...] = ()


class Configuration:
    """The symbols that a tree defines, with the values that a board `assigned`."""

    def __init__(self, definitions: Mapping[str, Sequence[Definition]], assigned: Mapping[str, str]) -> None:
        self.definitions = definitions
        self.assigned = assigned
        self.files: dict[str, None] = {}
        """The files with the definitions of the symbols that were read: the keys, in the order of their first use."""
        self._asked: list[str] = []
        self._known: dict[str, Truth] = {}

    def knows(self, symbol: str) -> bool:
        """Return whether the tree defines the symbol or the board assigns it."""
        return symbol in self.definitions or symbol in self.assigned

    def value_of(self, symbol: str) -> Truth:
        """Return whether a symbol is on, None if that is unknown. An undefined symbol is off unless it is assigned."""
        if symbol in self._known:
            return self._known[symbol]
        if symbol in self._asked or len(self._asked) == _MAX_DEPTH:
            return None
        definitions = self.definitions.get(symbol, ())
        if not definitions:
            return not is_false(self.assigned.get(symbol, ""))
        self.files |= {definition.name: None for definition in definitions}
        self._asked.append(symbol)
        values = [self._value(symbol, definition) for definition in definitions]
        self._asked.pop()
        self._known[symbol] = True if True in values else None if None in values else False
        return self._known[symbol]

    def _value(self, symbol: str, definition: Definition) -> Truth:
        met: Truth = True
        for condition in definition.depends:
            met = both(met, self._holds(condition))
        if met is False:
            return False
        if symbol in self.assigned:
            return both(met, not is_false(self.assigned[symbol]))
        for value, condition in definition.defaults:
            is_chosen = self._holds(condition) if condition else True
            if is_chosen is not False:
                return both(both(met, is_chosen), self._holds(value))
        return False

    def _holds(self, expression: str) -> Truth:
        return evaluate(_WORD.findall(expression), KCONFIG, self._operand)

    def _operand(self, words: Sequence[str]) -> Truth:
        if len(words) == 1:
            text = words[0]
            if text.startswith('"') or text in ("y", "n", "m") or text.isdigit():
                return not is_false(text.strip('"'))
            return self.value_of(text) if text.replace("_", "").isalnum() else None
        if len(words) == len(("A", "=", "y")) and words[1] in ("=", "!=") and words[2] in ("y", "n"):
            equal = self._operand(words[:1]) if words[2] == "y" else negated(self._operand(words[:1]))
            return equal if words[1] == "=" else negated(equal)
        return None


def parse_assignments(text: str) -> dict[str, str]:
    """Return the values that a configuration assigns to symbols, "" for symbols that it turns off."""
    found = {}
    for name, value, unset in _ASSIGNED.findall(text):
        found[name or unset] = value.strip().strip('"')
    return found


def read_definitions(tree: Files) -> dict[str, list[Definition]]:
    """Return the definitions of symbols in the Kconfig files of a tree: the one at its root and those that it reads."""
    found: dict[str, list[Definition]] = {}
    waiting: list[tuple[str, tuple[str, ...]]] = [(_ROOT, ())]  # the next one is the last
    seen: set[str] = set()
    while waiting:
        name, outer = waiting.pop()
        if name in seen or name.startswith(("/", "..")) or not tree.is_file(name):
            continue
        seen.add(name)
        text = tree.read(name).decode(errors="replace").replace("\\\n", " ")
        sources = _parse(text, name, outer, found)
        files = [(file, depends) for pattern, depends in sources for file in _matching(tree, pattern)]
        waiting += reversed(files)
    return found


def _parse(
    text: str, name: str, outer: tuple[str, ...], found: dict[str, list[Definition]]
) -> list[tuple[str, tuple[str, ...]]]:
    """Add the definitions in one file to `found`. Return the files that it reads, each with their dependencies."""
    sources: list[tuple[str, tuple[str, ...]]] = []
    blocks = [outer]
    symbol = ""
    for keyword, rest in _statements(text):
        if keyword in ("config", "menuconfig"):
            symbol = rest
            found.setdefault(symbol, []).append(Definition(name, (), blocks[-1]))
        elif keyword in _OPENS:
            symbol = ""
            blocks.append(_joined(blocks[-1], rest) if keyword == "if" else blocks[-1])
        elif keyword in _CLOSES:
            symbol = ""
            del blocks[max(1, len(blocks) - 1) :]
        elif keyword in _SOURCES:
            folder = posixpath.dirname(name) if "r" in keyword.removesuffix("source") else ""
            sources.append((posixpath.normpath(posixpath.join(folder, rest.strip('"'))), blocks[-1]))
        elif keyword == "depends":
            expression = rest.removeprefix("on").strip()
            if symbol:
                last = found[symbol][-1]
                found[symbol][-1] = last._replace(depends=_joined(last.depends, expression))
            else:
                blocks[-1] = _joined(blocks[-1], expression)
        elif keyword in _DEFAULTS and symbol:
            value, _, condition = rest.partition(" if ")
            last = found[symbol][-1]
            if len(last.defaults) < _MOST:
                found[symbol][-1] = last._replace(defaults=(*last.defaults, (value.strip(), condition.strip())))
    return sources


def _joined(conditions: tuple[str, ...], condition: str) -> tuple[str, ...]:
    """Return `conditions` with one more; only an unknown condition if they are too many."""
    return (_UNKNOWN,) if conditions[:1] == (_UNKNOWN,) or len(conditions) == _MOST else (*conditions, condition)


def _statements(text: str) -> Iterator[tuple[str, str]]:
    """Yield the keyword and the rest of each line. Help texts are left out."""
    margin: int | None = None
    in_help = False
    for raw in text.splitlines():
        line = raw.expandtabs()
        indent = len(line) - len(line.lstrip())
        if in_help and line.strip():
            margin = indent if margin is None else margin
            if indent >= margin > 0:
                continue
            in_help = False
        words = line.split("#")[0].split(maxsplit=1)
        if not words:
            continue
        if words[0] in _HELP:
            in_help, margin = True, None
        else:
            yield words[0], words[1].strip() if words[1:] else ""


def _matching(tree: Files, pattern: str) -> list[str]:
    """Return the files that match a pattern, in which `*` matches any characters except `/`."""
    found = [""]
    for part in pattern.split("/"):
        if any(mark in part for mark in "*?["):
            found = [f"{folder}{name}/" for folder in found for name in tree.names(folder) if fnmatchcase(name, part)]
        else:
            found = [f"{folder}{part}/" for folder in found]
    return [name.rstrip("/") for name in found]
