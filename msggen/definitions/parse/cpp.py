"""A tokenizer for C++ that removes comments and expands the macros defined in the same text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

UNKNOWN = "#"
"""The token for code that only a compiler can evaluate, such as a preprocessor condition."""

CLOSING = {"(": ")", "[": "]", "{": "}"}

_MAX_WORK = 500_000
"""Maximum number of tokens processed for one text. Headers of the firmware need up to 3000, macros any number."""

_MAX_DEPTH = 20
_SPLICE = re.compile(r"\\\r?\n")
_JOINED = "\v"
"""White space in place of a splice, which is counted as a line but does not end one. The text has no other `\\v`."""
_TOKEN = re.compile(
    r"""\s+|//[^\n]*|/\*.*?(?:\*/|\Z)
    |(?P<directive>\#[^\n]*)
    |(?P<token>"(?:[^"\\\n]|\\.)*"?|'(?:[^'\\\n]|\\.)*'?
    |\.?[0-9](?:[eEpP][+-]|['0-9a-zA-Z_.])*
    |[A-Za-z_]\w*
    |::|->|\+\+|--|&&|\|\||<<|>>|[-+*/%&|^<>=!]=|.)""",
    re.DOTALL | re.VERBOSE,
)
_INCLUDE = re.compile(r'\#\s*include\s*"([^"\n]+)"')
_DEFINE = re.compile(r"\#\s*define\s+(\w+)(\([^)]*\))?(.*)", re.DOTALL)
_UNDEFINE = re.compile(r"\#\s*undef\s+(\w+)")
_CONDITION = re.compile(r"\#\s*(?:if|el|endif)")


class TooLargeError(ValueError):
    """An error: the text is too large, or becomes too large when its macros are expanded."""


class Token(str):
    """A token with the number of its line. The tokens of a macro are in the line of its definition."""

    __slots__ = ("line",)
    line: int


def tokens(text: str) -> list[str]:
    """Return the tokens of C++ `text`. Raises TooLargeError."""
    return _Preprocessor().tokens(text)


def numbered_tokens(text: str) -> list[str]:
    """Return the tokens of C++ `text` as instances of Token where their line is known. Raises TooLargeError."""
    return _Preprocessor(is_numbered=True).tokens(text)


def line_of(token: str) -> int:
    """Return the number of the line of a token, 0 if it is unknown."""
    return token.line if isinstance(token, Token) else 0


def included(text: str) -> list[str]:
    """Return the names of the headers that `text` includes in quotes."""
    if not _INCLUDE.search(text):
        return []
    directives = (match["directive"] for match in _TOKEN.finditer(text) if match["directive"])
    return [found[1] for found in map(_INCLUDE.match, directives) if found]


def closings(code: Sequence[str]) -> dict[int, int]:
    """Return the positions of closing brackets by those of the opening ones. Unclosed brackets are left out."""
    found: dict[int, int] = {}
    waiting: list[int] = []
    for position, token in enumerate(code):
        if token in CLOSING:
            waiting.append(position)
        elif waiting and token == CLOSING[code[waiting[-1]]]:
            found[waiting.pop()] = position
    return found


class _Macro(NamedTuple):
    """A macro; `parameters` is None for a macro without parentheses."""

    parameters: tuple[str, ...] | None
    body: tuple[str, ...]


def _numbered(text: str, line: int) -> Token:
    token = Token(text)
    token.line = line
    return token


class _Preprocessor:
    def __init__(self, *, is_numbered: bool = False) -> None:
        self.is_numbered = is_numbered
        self.macros: dict[str, _Macro] = {}
        self.work = 0

    def tokens(self, text: str) -> list[str]:
        found: list[str] = []
        code: list[str] = []
        for token in self._split(_SPLICE.sub(_JOINED, text.replace(_JOINED, " "))):
            if not token.startswith("#"):
                code.append(token)
                continue
            found += self._expanded(code)
            code = []
            if _CONDITION.match(token):
                found.append(UNKNOWN)
            self._define(token)
        return found + self._expanded(code)

    def _split(self, text: str, line: int = 1) -> Iterator[str]:
        """Yield the tokens of `text`, which starts in `line`. A directive is one token."""
        for match in _TOKEN.finditer(text):
            self._count(1)
            if match.lastgroup:
                yield _numbered(match[match.lastgroup], line) if self.is_numbered else match[match.lastgroup]
            if self.is_numbered:
                line += match[0].count("\n") + match[0].count(_JOINED)

    def _count(self, number: int) -> None:
        self.work += number
        if self.work > _MAX_WORK:
            raise TooLargeError

    def _define(self, directive: str) -> None:
        undefined = _UNDEFINE.match(directive)
        if undefined:
            self.macros.pop(undefined[1], None)
        defined = _DEFINE.match(directive)
        if defined:
            name, parameters, text = defined.groups()
            names = None if parameters is None else tuple(part.strip() for part in parameters[1:-1].split(","))
            body = (UNKNOWN if token.startswith("#") else token for token in self._split(text, line_of(directive)))
            self.macros[name] = _Macro(names, tuple(body))

    def _expanded(self, code: Sequence[str], hidden: frozenset[str] = frozenset()) -> list[str]:
        """Return `code` with its macros expanded, except for the `hidden` ones, which are already being expanded."""
        if len(hidden) > _MAX_DEPTH:
            raise TooLargeError
        found: list[str] = []
        position = 0
        while position < len(code):
            self._count(1)
            name = code[position]
            position += 1
            macro = self.macros.get(name) if name not in hidden else None
            body: Sequence[str] | None = None
            if macro is not None:
                body, position = self._body(macro, code, position)
            if body is None:
                found.append(name)
            else:
                found += self._expanded(body, hidden | {name})
        return found

    def _body(self, macro: _Macro, code: Sequence[str], start: int) -> tuple[Sequence[str] | None, int]:
        """Return the expansion of a macro whose arguments begin at `start`, and the position after the arguments.

        The expansion is None if the arguments do not match the macro's parameters.
        """
        if macro.parameters is None:
            return macro.body, start
        arguments, end = self._arguments(code, start)
        if len(arguments) != len(macro.parameters):
            return None, start
        values = dict(zip(macro.parameters, arguments, strict=True))
        parts = [values.get(token, (token,)) for token in macro.body]
        self._count(sum(map(len, parts)))
        return list(chain.from_iterable(parts)), end

    def _arguments(self, code: Sequence[str], start: int) -> tuple[list[list[str]], int]:
        """Return the arguments in the parentheses at `start`, and the position after them.

        There are no arguments if no parenthesis opens at `start`, or if it is not closed.
        """
        arguments: list[list[str]] = [[]]
        depth = 0
        for position in range(start, len(code)):
            self._count(1)
            word = code[position]
            depth += (word == "(") - (word == ")")
            if depth == 0:
                break
            if word == "," and depth == 1:
                arguments.append([])
            elif position > start:
                arguments[-1].append(word)
        closed = start < len(code) and code[start] == "(" and depth == 0
        return (arguments, position + 1) if closed else ([], start)
