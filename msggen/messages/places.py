"""Values in messages by their paths: `nav_state`, `position[2]`, `esc[0].esc_rpm`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from enum import IntEnum, IntFlag
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from msggen.messages.packages import Message

Enum: TypeAlias = type[IntEnum] | type[IntFlag]

_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)(?:\[(-?[0-9]{1,9})\])?\Z")


class PlaceError(ValueError):
    """A path that a message does not have. The text names the nearest field."""


class Place(NamedTuple):
    """A value in the messages of a class: a field, or an element of one."""

    path: str
    get: Callable[[Any], Any]
    """Returns the value in a message."""
    message: type[Message]
    """The class that has the field."""
    field: Any
    """The `Field` of the generated package."""
    is_element: bool
    """Whether the value is an element of the array `field`."""

    @property
    def base(self) -> str:
        """The type of one value: `float32`."""
        return str(self.field.base)

    @property
    def is_text(self) -> bool:
        """Whether the value is text: `char[N]`, or a string."""
        is_string = self.base.partition("<=")[0] in ("string", "wstring")
        has_many = self.field.length is not None or self.field.is_sequence
        return (self.base == "char" and has_many and not self.is_element) or (is_string and not self.is_array)

    @property
    def is_array(self) -> bool:
        """Whether the value is an array. Text in `char[N]` is none."""
        has_many = self.field.length is not None or self.field.is_sequence
        return has_many and not self.is_element and self.base != "char"

    @property
    def enum(self) -> Enum | None:
        """The enum of the value, or of the elements of an array."""
        found: Enum | None = self.message.__msg__.enum(self.field.name)
        return found

    @property
    def nested(self) -> type[Message] | None:
        """The class of the message that the value is, or that the elements of an array are."""
        value = getattr(self.message(), self.field.attribute)
        first = value[0] if isinstance(value, tuple) and value else value
        return type(first) if hasattr(first, "__msg__") else None


def place_of(message: type[Message], path: str) -> Place:
    """Return the value that a path names. Raises PlaceError."""
    found: Place | None = None
    for step in path.split("."):
        cls: type[Message] | None = message
        if found is not None:
            cls = found.nested
            if cls is None or found.is_array:
                hint = f": write '{found.path}[0].{step}'" if cls else ""
                raise PlaceError(f"'{found.path}' is {found.field.type}, and has no fields{hint}")
        match = _STEP.match(step)
        if match is None or cls is None:
            raise PlaceError(f"'{path}' is not a path such as 'nav_state', 'position[2]' or 'esc[0].esc_rpm'")
        found = _step(found, cls, match[1], None if match[2] is None else int(match[2]))
    if found is None:
        raise PlaceError(f"'{path}' is empty")
    return found


def places_of(message: type[Message]) -> Iterator[Place]:
    """Yield the fields of a message, in the order of its definition."""
    for field in message.__msg__.fields:
        yield _step(None, message, field.name, None)


def text_of(value: bytes | str) -> str:
    """Return the text of a value that is text: that of `char[N]` ends at its first zero byte."""
    return value if isinstance(value, str) else value.partition(b"\0")[0].decode(errors="replace")


def _step(outer: Place | None, message: type[Message], name: str, index: int | None) -> Place:
    """Return the place of a field in `message`, or of one of its elements, which `outer` contains."""
    try:
        field = message.__msg__.field(name)
    except KeyError as error:
        raise PlaceError(str(error)) from None
    path = f"{outer.path}.{name}" if outer else name
    whole = Place(path, _getter(outer, field.attribute, None), message, field, is_element=False)
    if index is None:
        return whole
    if not whole.is_array:
        raise PlaceError(f"'{path}' is {'text' if whole.is_text else field.type}, and has no elements")
    length = field.length
    if length is not None and not -length <= index < length:
        raise PlaceError(f"'{path}' has {length} values, 0 to {length - 1}, and no [{index}]")
    get = _getter(outer, field.attribute, index)
    return Place(f"{path}[{index}]", get, message, field, is_element=True)


def _getter(outer: Place | None, attribute: str, index: int | None) -> Callable[[Any], Any]:
    if outer is not None:
        inside = outer.get
        if index is None:
            return lambda message: getattr(inside(message), attribute)
        return lambda message: getattr(inside(message), attribute)[index]
    if index is None:
        return lambda message: getattr(message, attribute)
    return lambda message: getattr(message, attribute)[index]
