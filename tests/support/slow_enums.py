"""The constants of enums by the rules of msggen/definitions/enumeration.py: each tag looks at every constant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from msggen.definitions.model import SPECIAL, Constant, Field, Message
from msggen.definitions.primitives import PRIMITIVES

COUNTS = ("NUM", "NUMBER", "COUNT", "ENUM_END")
LIMITS = ("MAX", "END", "LAST", "SIZE")


class SlowEnum(NamedTuple):
    """An enum: its tag, the prefixes that constants have, and the names of its constants."""

    tag: str
    prefixes: tuple[str, ...]
    constants: tuple[str, ...]


def slow_enums(message: Message) -> Iterator[SlowEnum]:
    """Yield the enums of fields, in their order. Tags are words that are divided by spaces."""
    integers = {each.name: each for each in message.constants if type(each.value) is int and each.name not in SPECIAL}
    tags = dict.fromkeys(field.comment.tag("enum") for field in message.fields if _is_integer(field))
    prefixes = {tag: slow_prefixes(tag, integers) for tag in tags if tag}
    every = {prefix for each in prefixes.values() for prefix in each}
    for tag, own in prefixes.items():
        names = [name for name in integers if _owner(name, every) in own]
        left = tuple(name for name in names if not _is_count(name, names, integers))
        if left:
            yield SlowEnum(tag, own, left)


def slow_prefixes(tag: str, names: Iterable[str]) -> tuple[str, ...]:
    """Return the prefixes in a tag, each without the first words that no name has."""
    found = []
    for word in tag.split():
        rest = word.rstrip("_")
        while rest and not any(name.startswith(f"{rest}_") for name in names):
            rest = rest.partition("_")[2]
        if rest and rest not in found:
            found.append(rest)
    return tuple(found)


def _is_integer(field: Field) -> bool:
    return field.type.is_primitive and PRIMITIVES[field.type.name].is_integer


def _owner(name: str, prefixes: Iterable[str]) -> str | None:
    return max((each for each in prefixes if name.startswith(f"{each}_")), key=len, default=None)


def _is_count(name: str, names: Iterable[str], integers: Mapping[str, Constant]) -> bool:
    """Whether a constant counts the others."""
    others = [_value(integers[other]) for other in names if other != name]
    value = _value(integers[name])
    largest = max(others, default=value)
    ends = [f"_{each}" for each in COUNTS], [f"_{each}" for each in LIMITS]
    is_count, is_limit = (any(name.endswith(end) for end in each) for each in ends)
    return (is_count and value > largest) or (is_limit and value == largest + 1)


def _value(constant: Constant) -> int:
    assert isinstance(constant.value, int)
    return constant.value
