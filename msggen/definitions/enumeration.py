"""The enums of a message: the constants that are the values of its fields.

A field names its constants by prefix, in a tag of its own or in an inferred one (msggen/sources/inferred.py):
`[@enum NAVIGATION_STATE]` are the integer constants `NAVIGATION_STATE_*`.

- A tag may have several prefixes: `[@enum WARNING STATE]`.
- If no constant has the prefix, its first words are left out until constants have it: PX4 writes
  `[@enum VTE_FUSION_STATUS]` for `STATUS_*`.
- A constant belongs to its longest prefix in the message: `VEHICLE_CMD_RESULT_DENIED` is not a `VEHICLE_CMD`.
- The parameters of a command name constants as well: `VEHICLE_CMD_DO_SET_ROI` has `|[@enum VEHICLE_ROI] ...|`.
- A constant such as `FAULT_COUNT` that counts the others is not a member.
- The enum is a set of flags if the name or the comment of a field says that it is a mask. The constants are then
  masks, or numbers of bits.
- The enums of a message have at most MOST_MEMBERS together: a small definition could otherwise name all constants in
  each of its tags. A tag with more than are left makes none.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from msggen.definitions.model import SPECIAL, ArrayKind, Constant, Field, Message
from msggen.definitions.primitives import PRIMITIVES

_COUNT = re.compile(r"(?:^|_)(?:NUM|NUMBER|COUNT|ENUM_END)$")
_LIMIT = re.compile(r"(?:^|_)(?:MAX|END|LAST|SIZE)$")
"""The names of constants that are no members if they are larger than all others, or larger by 1."""

_OF_PARAMETER = re.compile(r"\|[^|]*?\[@enum ([^\]|]*)\]")
_NOTHING = re.compile(r"(?:^|_)(?:NONE|NO|OK|OFF|UNKNOWN|UNDEFINED|DEFAULT|CLEAR|EMPTY|ZERO)(?:_|$)")
_MASK_NAME = re.compile(r"(?:^|_)(?:flags|bits|(?:bit)?mask|bit_?field|bitmap)$")
_MASK_TEXT = re.compile(r"\bbit[- ]?(?:masks?|fields?|maps?|sets?)\b|\bmasks?\b|\bone bit each\b", re.IGNORECASE)

MOST_MEMBERS = 1 << 16
"""The most members that all enums of a message have together: those of PX4's VehicleCommand have some hundreds."""
_OWN_FLAGS = 4
"""The number of constants from which single bits, and no other values, are flags without a comment that says so."""


class Member(NamedTuple):
    """A member of an enum. `value` is the value of the constant, or `1 << value` if the constant is a bit number."""

    name: str
    value: int
    constant: Constant


class Enumeration(NamedTuple):
    """The constants that are the values of a field, or of several fields with the same tag."""

    tag: str
    """The content of the tag: `NAVIGATION_STATE`."""
    prefixes: tuple[str, ...]
    """The prefixes that the constants have."""
    members: tuple[Member, ...]
    is_flags: bool
    """Whether a value combines members, each of which is a bit."""
    has_bit_numbers: bool
    """Whether the constants are numbers of bits: the member `1 << 3` for a constant 3."""
    fields: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name in CamelCase: `NavigationState`. It is that of the prefixes if the tag makes no name."""
        name = _camel_case(self.tag)
        return name if name.isidentifier() else _camel_case(" ".join(self.prefixes))


def _camel_case(text: str) -> str:
    return "".join(word.capitalize() for word in re.findall("[A-Za-z0-9]+", text))


def enumerations(message: Message) -> tuple[Enumeration, ...]:
    """Return the enums of `message`, in the order of the first field of each. A tag without constants makes none.

    Enums of the parameters of commands follow. They have no fields.
    """
    fields: dict[str, list[Field]] = {}
    for field in message.fields:
        tag = field.comment.tag("enum")
        if tag and is_integer(field):
            fields.setdefault(tag, []).append(field)
    for constant in message.constants:
        for tag in _OF_PARAMETER.findall(constant.comment.text):
            fields.setdefault(tag, [])
    prefixes = {tag: constant_prefixes(message, tag) for tag in fields}
    owners = Prefixes(prefix for each in prefixes.values() for prefix in each)
    owned: dict[str, list[tuple[int, Constant]]] = {}
    for place, constant in enumerate(integer_constants(message)):
        owned.setdefault(owners.longest(constant.name), []).append((place, constant))
    made = (
        _enumeration(tag, prefixes[tag], fields[tag], _in_order(owned, prefixes[tag]))
        for tag in _within_limit({tag: sum(len(owned.get(each, ())) for each in prefixes[tag]) for tag in fields})
    )
    return tuple(one for one in made if one.members)


def _within_limit(sizes: Mapping[str, int]) -> Iterator[str]:
    """Yield the tags of `sizes`, without those whose members would exceed MOST_MEMBERS."""
    rest = MOST_MEMBERS
    for tag, size in sizes.items():
        if size <= rest:
            rest -= size
            yield tag


def _in_order(owned: Mapping[str, Sequence[tuple[int, Constant]]], prefixes: Iterable[str]) -> Iterator[Constant]:
    """Yield the constants that prefixes own, in the order of the message. `owned` has their places, too."""
    found = [one for prefix in prefixes for one in owned.get(prefix, ())]
    yield from (constant for _, constant in sorted(found, key=lambda one: one[0]))


class Prefixes:
    """Prefixes of names, found without a step for each of them."""

    def __init__(self, prefixes: Iterable[str]) -> None:
        self._by_length: dict[int, set[str]] = {}
        for prefix in prefixes:
            self._by_length.setdefault(len(prefix), set()).add(prefix)

    def longest(self, name: str) -> str:
        """Return the longest of the prefixes with which `name` begins, and `_` behind it; "" if there is none."""
        ends = [found.start() for found in re.finditer("_", name) if found.start() in self._by_length]
        fronts = (name[:end] for end in reversed(ends))
        return next((front for front in fronts if front in self._by_length[len(front)]), "")


class _Named:
    """The integers among constants, sorted by name to find those with a prefix."""

    def __init__(self, constants: Iterable[Constant]) -> None:
        self.integers = [each for each in constants if type(each.value) is int and each.name not in SPECIAL]
        self._places = sorted(range(len(self.integers)), key=lambda place: self.integers[place].name)
        self._names = [self.integers[place].name for place in self._places]
        self.longest = max(map(len, self._names), default=0)

    def has(self, prefix: str) -> bool:
        """Whether the name of a constant begins with `prefix` and `_`."""
        start = f"{prefix}_"
        place = bisect_left(self._names, start)
        return any(name.startswith(start) for name in self._names[place : place + 1])

    def of(self, prefix: str) -> Iterator[Constant]:
        """Yield the constants whose names begin with `prefix` and `_`, in their order."""
        behind = chr(ord("_") + 1)
        low, high = (bisect_left(self._names, f"{prefix}{end}") for end in ("_", behind))
        yield from (self.integers[place] for place in sorted(self._places[low:high]))


class _Same(NamedTuple):
    """Constants, of which only the same tuple is equal: a look at each would take as long as the work that is saved."""

    constants: tuple[Constant, ...]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.constants is other.constants

    def __hash__(self) -> int:
        return id(self.constants)


@lru_cache(512)
def _named(of: _Same) -> _Named:
    """Return the constants of a message by name, once for all of its fields."""
    return _Named(of.constants)


def is_integer(field: Field) -> bool:
    """Whether the values of `field` are integers."""
    return field.type.is_primitive and PRIMITIVES[field.type.name].is_integer


def integer_constants(message: Message) -> list[Constant]:
    """Return the constants with integer values."""
    return list(_named(_Same(message.constants)).integers)


def constant_prefixes(message: Message, tag: str) -> tuple[str, ...]:
    """Return the prefixes in the tag `[@enum ...]`, without leading words that no constant has."""
    named = _named(_Same(message.constants))
    found = (_prefix(prefix, named) for prefix in re.findall(r"\w+", tag))
    return tuple(dict.fromkeys(prefix for prefix in found if prefix))


def _prefix(prefix: str, named: _Named) -> str:
    whole = prefix.rstrip("_")
    starts = (0, *(found.end() for found in re.finditer("_", whole)))
    tails = (whole[start:] for start in starts if len(whole) - start < named.longest)
    return next((tail for tail in tails if named.has(tail)), "")


def _enumeration(
    tag: str, prefixes: tuple[str, ...], users: Sequence[Field], constants: Iterable[Constant]
) -> Enumeration:
    found: dict[str, Constant] = {}
    for constant in constants:
        name = constant.name if len(prefixes) > 1 else constant.name[len(prefixes[0]) + 1 :]
        found[_identifier(name, constant.name)] = constant
    found = _without_end(found)
    values = [int(constant.value) for constant in found.values()]  # type: ignore[arg-type]  # checked above
    is_flags, has_bit_numbers = _kind(found, values, users)
    members = tuple(
        Member(name, 1 << value if has_bit_numbers else value, constant)
        for (name, constant), value in zip(found.items(), values, strict=True)
    )
    return Enumeration(tag, prefixes, members, is_flags, has_bit_numbers, tuple(field.name for field in users))


def _identifier(name: str, whole: str) -> str:
    """Return `name`, with the words before it if it cannot stand alone: `TYPE_2D` of FIX_TYPE_2D."""
    while not name.isidentifier() and len(name) < len(whole):
        before = whole[: -len(name) - 1]
        name = f"{before.rpartition('_')[2]}_{name}"
    return name


def _without_end(found: Mapping[str, Constant]) -> dict[str, Constant]:
    """Return the constants without those that count the others."""
    values = sorted(int(one.value) for one in found.values())  # type: ignore[arg-type]  # integers

    def counts(name: str, value: int) -> bool:
        others = values[-2:-1] if value == values[-1] else values[-1:]
        largest = max(others, default=value)
        return bool((_COUNT.search(name) and value > largest) or (_LIMIT.search(name) and value == largest + 1))

    return {name: one for name, one in found.items() if not counts(name, int(one.value))}  # type: ignore[arg-type]


def _kind(found: Mapping[str, Constant], values: Sequence[int], users: Sequence[Field]) -> tuple[bool, bool]:
    """Return whether the enum is a set of flags, and whether its constants are numbers of bits."""
    bits = [value for value in values if value]
    are_bits = bool(bits) and all(value > 0 and value & (value - 1) == 0 for value in bits)
    if are_bits and len(set(bits)) >= _OWN_FLAGS:
        return True, False
    if not users or not all(map(_is_mask, users)):
        return False, False
    zero = next((name for name, constant in found.items() if constant.value == 0), "NONE")
    if are_bits and _NOTHING.search(zero):
        return True, False
    width = min(8 * PRIMITIVES[field.type.name].size for field in users)
    are_numbers = len(set(values)) == len(values) and all(0 <= value < width for value in values)
    return are_numbers, are_numbers


def _is_mask(field: Field) -> bool:
    """Whether the name or the comment of `field` says that its values are combinations of bits."""
    return bool(_MASK_NAME.search(field.name) or _MASK_TEXT.search(field.comment.text))


def enum_by_name(message: Message, field: Field) -> str:
    """Return the prefix of the constants that have the name of `field`: `SOURCE` for `source`; "" if in doubt.

    The field must be a single integer, and it must be able to hold the constants. There must be at least two constants,
    with different values: consecutive numbers that start at 0, 1 or a negative number, or bits.
    """
    prefix = field.name.upper()
    if field.type.array is not ArrayKind.SCALAR or not is_integer(field):
        return ""
    named = _enumeration(prefix, (prefix,), [field], _named(_Same(message.constants)).of(prefix))
    values = sorted({int(member.constant.value) for member in named.members})  # type: ignore[arg-type]
    is_dense = bool(values) and values[0] <= 1 and values == list(range(values[0], values[0] + len(values)))
    low, high = PRIMITIVES[field.type.name].integer_range
    fits = all(low <= member.value <= high for member in named.members)
    return prefix if len(values) > 1 and fits and (is_dense or named.is_flags) else ""
