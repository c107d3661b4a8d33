"""Evidence that two fields with different names are the same field, renamed.

The same position and type are not enough: `bool geofence_max_alt_triggered` once took the byte of
`bool primary_geofence_breached`. Names, comments or units must agree too. The result is the same in both directions.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from itertools import takewhile
from operator import eq
from typing import NamedTuple

from msggen.definitions.model import Field
from msggen.definitions.unit import normalized_unit

_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_LETTERS = re.compile(r"\w+")

_SYNONYMS = {"gnss": "gps", "sp": "setpoint", "hdg": "heading", "ref": "reference"}
_NEGATIONS = {"not", "no", "non", "without", "ignore", "ignored", "inhibit", "invalid", "inverse", "inverted"}
_NEGATIONS |= {"disable", "disabled", "disallow"}
_NEGATING_PREFIXES = {"un", "in", "im", "dis", "non", "de", "anti"}
_QUANTITIES = {"rate", "derivative", "integral", "setpoint", "reference", "error", "innov", "innovation"}
_QUANTITIES |= {"variance", "var", "std", "min", "max", "sum", "count", "counter"}
_OTHER_MEANING = _NEGATIONS | _QUANTITIES
"""Words that give a name another meaning, if only one of two names has them: `yaw` and `yaw_rate`."""

_SHORTEST_WORD = 3
"""The length of the shortest word that identifies a field. Shorter words, such as `x` in `gyro_x`, do not."""
_SHORTEST_STEM = 4
"""The minimum length of a common prefix that makes two words similar, unless one abbreviates the other."""
_SHORTEST_COMMENT = 3
"""The number of words in the shortest comment that identifies a field."""
_NEAR = 0.6
"""The smallest similarity, from 0 to 1, of the two names of a renamed message."""


class Candidates(NamedTuple):
    """The fields on the previous side only, those on the current side only, and those on both sides."""

    lost: Sequence[Field]
    gained: Sequence[Field]
    kept: Sequence[Field]


def is_renamed(before: Field, after: Field, fields: Candidates) -> bool:
    """Whether `after` is `before` under another name, given that both have the same type in the same bytes."""
    common = _Common(words(before.name), words(after.name))
    if common.has_other_meaning:
        return False
    if _has_same_comment(before, after):
        return True
    if _has_nearer(before, after, fields):
        return False
    if common.is_near:
        return True
    units = [_unit(field) for field in (before, after)]
    if all(units) and units[0] != units[1]:
        return False
    others = [field for field in (*fields.lost, *fields.gained, *fields.kept) if field not in (before, after)]
    is_same_unit = units[0] == units[1] not in ("", "1")
    return bool(common.shared) if is_same_unit else common.is_distinctive({w for f in others for w in words(f.name)})


def nearest_message(name: str, others: Iterable[str]) -> str | None:
    """Return the name among `others` that is most likely the new name of a message, or None if no name is near."""
    from difflib import SequenceMatcher

    ratios = {other: SequenceMatcher(None, name, other).ratio() for other in others}
    near = [other for other in ratios if _is_near(name, other, ratios[other])]
    return max(near, key=lambda other: ratios[other], default=None)


def _is_near(name: str, other: str, ratio: float) -> bool:
    common = _Common(words(name), words(other))
    first, second = common.rest
    differ_in_number = any(map(str.isdecimal, first)) and any(map(str.isdecimal, second))
    return (common.is_near or ratio >= _NEAR) and not (
        _OTHER_MEANING.intersection((*first, *second)) or differ_in_number
    )


def words(name: str) -> tuple[str, ...]:
    """Return the words of a name in snake_case or CamelCase; numbers are separate words."""
    found = (word.lower() for word in _WORD.findall(name))
    return tuple(_SYNONYMS.get(word, word) for word in found)


class _Common:
    """The words that two names have in common."""

    def __init__(self, first: Sequence[str], second: Sequence[str]) -> None:
        self.first, self.second = first, second
        self.shared = _pair(first, second)
        taken = [[pair[side] for pair in self.shared] for side in (0, 1)]
        self.rest = _without(first, taken[0]), _without(second, taken[1])

    @property
    def has_same_letters(self) -> bool:
        """Whether the names differ only in underscores and capitals."""
        return "".join(self.first) == "".join(self.second)

    @property
    def has_other_meaning(self) -> bool:
        """Whether a word that only one name has makes it another quantity, axis or number."""
        first, second = self.rest
        return not self.has_same_letters and (
            bool(_OTHER_MEANING.intersection((*first, *second)))
            or any(_is_negation(one, other) for one in first for other in second)
            or not (all(map(_is_identifying, first)) or all(map(_is_identifying, second)))
        )

    @property
    def is_near(self) -> bool:
        """Whether one name has all words of the other, or both have the same letters."""
        return bool(self.shared and not all(self.rest)) or self.has_same_letters

    @property
    def likeness(self) -> float:
        """The share of words that both names have, from 0 to 1."""
        return 2 * len(self.shared) / (len(self.first) + len(self.second) or 1)

    def is_distinctive(self, others: Collection[str]) -> bool:
        """Whether the names share at least half of their words, not counting words that are in `others`."""
        shared = [pair for pair in self.shared if not any(_is_among(word, others) for word in pair)]
        shared = [pair for pair in shared if all(map(_is_identifying, pair))]
        return bool(shared) and 2 * len(shared) >= max(len(self.first), len(self.second))


def _unit(field: Field) -> str:
    return normalized_unit(field.comment.unit)


def _has_same_comment(before: Field, after: Field) -> bool:
    """Whether both comments have the same words and tags, and enough words to identify a field.

    Only the last line of the text counts, because lines above the first field of a group may describe the group.
    """
    texts = [_LETTERS.findall(field.comment.text.lower().rpartition("\n")[2]) for field in (before, after)]
    tags = [field.comment._replace(text="", unit=_unit(field), inferred=()) for field in (before, after)]
    return texts[0] == texts[1] and tags[0] == tags[1] and len(texts[0]) >= _SHORTEST_COMMENT


def _has_nearer(before: Field, after: Field, fields: Candidates) -> bool:
    """Whether another added field has a name nearer to `before`, or another removed field a name nearer to `after`."""
    likeness = _likeness(before, after)
    rivals = [(before, field) for field in fields.gained if field != after]
    rivals += [(field, after) for field in fields.lost if field != before]
    return any(_likeness(*rival) > likeness for rival in rivals)


def _likeness(before: Field, after: Field) -> float:
    return _Common(words(before.name), words(after.name)).likeness


def _pair(first: Iterable[str], second: Iterable[str]) -> list[tuple[str, str]]:
    """Return the pairs of words that both names have: first equal words, then words with a similar spelling."""
    left, right = list(first), list(second)
    found: list[tuple[str, str]] = []
    for is_same in (str.__eq__, _are_spelled_alike):
        for word in tuple(left):
            twin = next((other for other in right if is_same(word, other)), None)
            if twin is not None:
                left.remove(word)
                right.remove(twin)
                found.append((word, twin))
    return found


def _without(all_words: Iterable[str], taken: Iterable[str]) -> list[str]:
    rest = list(all_words)
    for word in taken:
        rest.remove(word)
    return rest


def _are_spelled_alike(first: str, second: str) -> bool:
    """Whether one word abbreviates the other, both have the same stem, or they differ by a typing error.

    A typing error is one extra letter or two swapped letters. A replaced letter is not: `attitude`, `altitude`.
    """
    short, long = sorted((first, second), key=len)
    if len(short) < _SHORTEST_WORD or _is_negation(short, long):
        return False
    if long.startswith(short) or len(short) < _SHORTEST_STEM:
        return long.startswith(short)
    start = _count_same(short, long)
    end = min(_count_same(short[::-1], long[::-1]), len(short) - start)
    middle, longer_middle = short[start : len(short) - end], long[start : len(long) - end]
    has_stem = start >= _SHORTEST_STEM and 2 * start >= len(long)
    has_typo = len(middle) + len(longer_middle) == 1 or (len(middle) == 2 and middle == longer_middle[::-1])  # noqa: PLR2004
    return has_stem or long.endswith(short) or has_typo


def _count_same(first: str, second: str) -> int:
    """Return the length of the common prefix of two words."""
    return sum(takewhile(bool, map(eq, first, second)))


def _is_negation(first: str, second: str) -> bool:
    """Whether one word is the other word with a negating prefix such as `in`."""
    short, long = sorted((first, second), key=len)
    return long.endswith(short) and long[: len(long) - len(short)] in _NEGATING_PREFIXES


def _is_identifying(word: str) -> bool:
    return len(word) >= _SHORTEST_WORD and not word.isdecimal()


def _is_among(word: str, others: Collection[str]) -> bool:
    return word in others or any(_are_spelled_alike(word, other) for other in others)
