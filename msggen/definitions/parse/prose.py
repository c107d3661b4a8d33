"""The reader of units in sentences: "Ground speed in m/s", "Time since boot (microseconds)".

It returns a unit only if there is no doubt. Otherwise the unit of a field stays unknown.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

from msggen.definitions.unit import SPELLINGS, known_unit

_LONGEST_TEXT = 2000
_LONGEST_UNIT = 40

_OPENING = re.compile(r"\(|\[|in |In ")  # literals, for which the search is fast
_BRACKETED = re.compile(r"((?:[^()\[\]]|\([^()]*\))+)([)\]]?)([\^*/\w]?)")
_WORD = re.compile(r"(?:[^\s,;:.()\[\]]|\([^\s()]*\)|\.(?=\d))+")

_NAME = re.compile(r"(?:1[eE]-\d+ ?)?\(?([^\W\d]+|[°%])")

_OTHER_WORDS = frozenset({"min", "h", "A", "F", "G", "Gs", "K", "N", "V", "W", "second", "minute", "foot", "byte"})
"""Spellings that often mean something else if they are alone: "in second gear", "north (N)", "(min)"."""

_CONTINUED = frozenset(
    {"*", "/", "x", "·", "\N{MULTIPLICATION SIGN}", "^", "per", "times", "squared", "cubed", "of", "or", "and"}
)
"""Words after a unit that change it, or name another one."""

_DOUBT = re.compile(
    r"\b(?:also|scal(?:e[ds]?|ing)|multipl\w+|times|units? of|steps? of|lsb|(?:ten|hundred|thousand)ths?)\b"
    r"|[*x\N{MULTIPLICATION SIGN}/] ?10+\b|(?<!in )(?<![(\[])\b1e[-+]?\d|\b10\^"
)
"""A sign in lower case that the value is a multiple or a fraction of the unit, or that it has a second meaning."""


@lru_cache(maxsize=1000)
def unit_in(text: str) -> str:
    """Return the unit that `text` mentions, in its usual spelling; "" if there is none, or any doubt about it."""
    if len(text) > _LONGEST_TEXT:
        return ""
    found = set(_mentioned(text))
    return found.pop() if len(found) == 1 and not _DOUBT.search(text.lower()) else ""


def _mentioned(text: str) -> Iterator[str]:
    """Yield the units after "in" and in brackets, and "" for one in doubt."""
    for opening in _OPENING.finditer(text):
        start, end = opening.span()
        before, rest = text[max(start - 4, 0) : start], text[end : end + _LONGEST_UNIT].partition("\n")[0]
        if end - start > 1:
            if not before[-1:].isalnum() and before.lower() != "not ":
                yield from _leading(rest)
        elif not (rest.startswith("s)") and before[-1:].isalpha()):  # a plural, such as "LED(s)"
            yield from _bracketed(rest, is_square=opening[0] == "[")


def _bracketed(text: str, *, is_square: bool) -> Iterator[str]:
    """Yield the units at the start of a list in brackets, such as `m/s` in `(m/s, positive)`."""
    found = _BRACKETED.match(text)
    if not found:
        return
    inside, end, power = found.groups()
    items = [item.strip() for item in re.split("[,;]", inside)]
    is_tag = is_square and len(items) == 1 and inside != "min"
    units = [known_unit(item) if is_tag else _unit(item) for item in (items if end else items[:-1])]
    if units and units[0]:
        yield from ("" if power else unit for unit in units if unit)


def _leading(text: str) -> Iterator[str]:
    """Yield the unit at the start of `text`, of up to four words."""
    first = _NAME.match(text)
    if not first or first[1] not in SPELLINGS:
        return
    ends = [word.end() for word, _ in zip(_WORD.finditer(text), range(4), strict=False)]
    for end in reversed(ends):
        unit = _unit(text[:end])
        if unit:
            following = text[end:].split(maxsplit=1)
            yield "" if following and following[0] in _CONTINUED else unit
            return


def _unit(text: str) -> str:
    return "" if text in _OTHER_WORDS else known_unit(text)
