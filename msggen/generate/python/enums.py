"""The model of the enums in a message class for the Python templates."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from msggen.definitions.enumeration import Enumeration, enumerations
from msggen.definitions.model import Message
from msggen.generate.python.formatting import documentation
from msggen.generate.python.names import enum_names, member_names


class EnumMember(NamedTuple):
    """A member of an enum. `spaced` puts a blank line before it."""

    name: str
    value: str
    documentation: str
    spaced: bool


class EnumClass(NamedTuple):
    """An enum in a class. `tag` is the content of its tag, and `fields` have its values."""

    name: str
    base: str
    documentation: str
    members: tuple[EnumMember, ...]
    tag: str
    fields: tuple[str, ...]


def enum_classes(message: Message, attributes: Mapping[str, str], classes: Collection[str]) -> tuple[EnumClass, ...]:
    """Return the enums of `message`. `attributes` are the names of its fields and constants in Python.

    `classes` are the names of classes in its module.
    """
    names = enum_names(enumerations(message), {*attributes.values(), *classes})
    return tuple(_enum_class(enum, name, attributes) for enum, name in names.items())


def _enum_class(enum: Enumeration, name: str, attributes: Mapping[str, str]) -> EnumClass:
    """Return the class of an enum. Its members have the documentation of their constants."""
    users = [f"`{attributes[field]}`" for field in enum.fields]
    values = "Flags" if enum.is_flags else "Values"
    text = f"{values} of {', '.join(users)}." if users else f"{values} of parameters of commands."
    if enum.has_bit_numbers:
        text += f" The constants {' and '.join(f'{prefix}_*' for prefix in enum.prefixes)} are bit numbers."
    base = "IntFlag" if enum.is_flags else "IntEnum"
    return EnumClass(name, base, documentation(text, 8), tuple(_members(enum)), enum.tag, enum.fields)


def _members(enum: Enumeration) -> Iterator[EnumMember]:
    """Yield the members. Those with documentation are separated by blank lines."""
    apart = True
    names = member_names([member.name for member in enum.members])
    for member in enum.members:
        text = documentation(str(member.constant.comment), 8, closed=True)
        yield EnumMember(names[member.name], str(member.value), text, apart or bool(text))
        apart = bool(text)
