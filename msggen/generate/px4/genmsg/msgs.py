"""Messages for templates. Each template gets its own, because a template may change them."""

from __future__ import annotations

from collections.abc import Iterable

from msggen.definitions.primitives import PRIMITIVES

_BUILTIN = frozenset((*PRIMITIVES, "time", "duration"))
_HEADERS = ("Header", "std_msgs/Header", "roslib/Header")


def parse_type(msg_type: str) -> tuple[str, bool, int | None]:
    """Return the type of one value, whether the type is an array, and its fixed length or None.

    For `uint8[4]`, these are `uint8`, True and 4. Raises ValueError for an invalid type.
    """
    base, bracket, length = msg_type.partition("[")
    if not bracket:
        if not base:
            raise ValueError("expected a type, found an empty string")
        return base, False, None
    if length == "]":
        return base, True, None
    if not (length.endswith("]") and length[:-1].isdecimal()):
        raise ValueError(f"cannot read type '{msg_type}'")
    return base, True, int(length[:-1])


def bare_msg_type(msg_type: str) -> str:
    """Return the type of one value: `uint8` for `uint8[4]`."""
    return msg_type.partition("[")[0]


def is_builtin(msg_type_name: str) -> bool:
    """Whether a type is primitive, not a message."""
    return msg_type_name in _BUILTIN


class Field:
    """A field. `type` is its full type (`px4/EscReport[8]`), `base_type` the type of one value."""

    def __init__(self, name: str, type: str) -> None:  # noqa: A002 - templates may name it
        self.name = name
        self.type = type
        self.base_type, self.is_array, self.array_len = parse_type(type)
        self.is_header = type in _HEADERS
        self.is_builtin = self.base_type in _BUILTIN

    def __repr__(self) -> str:
        return f"<Field {self.type} {self.name}>"


class Constant:
    """A constant. `val` is its value."""

    def __init__(self, type_: str, name: str, val: object) -> None:
        self.type = type_
        self.name = name
        self.val = val

    def __repr__(self) -> str:
        return f"<Constant {self.type} {self.name}={self.val}>"


class MsgSpec:
    """A message. `full_name` is `px4/EscReport`, `package` and `short_name` are its two parts."""

    def __init__(self, full_name: str, fields: Iterable[Field], constants: Iterable[Constant], text: str) -> None:
        self.full_name = full_name
        self.package, _, self.short_name = full_name.rpartition("/")
        self.constants = [*constants]
        self.text = text
        self._fields = [*fields]
        self.types = [field.type for field in self._fields]
        self.names = [field.name for field in self._fields]

    def parsed_fields(self) -> list[Field]:
        """Return the fields, always the same list."""
        return self._fields

    def __str__(self) -> str:
        return self.text
