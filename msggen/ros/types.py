"""Message types that are installed for rclpy, compared with the definitions of a vehicle."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any, Protocol, TypeAlias

from msggen.messages.packages import Message, package_of_class


class RosType(Protocol):
    """What is needed of a message class of rclpy. Every distribution of ROS 2 has it."""

    @classmethod
    def get_fields_and_field_types(cls) -> Mapping[str, str]:
        """Return the type of each field, such as `float[3]` or `px4_msgs/EscReport[8]`, in the order of the fields."""
        ...


Finder: TypeAlias = Callable[[str], Any]
"""Returns the class of a type such as `px4_msgs/msg/VehicleStatus` or `px4_msgs/srv/VehicleCommand`.

None if it is not installed.
"""

_NAMES = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}
"""The names of rosidl for types that it renames."""


def installed(ros_type: str) -> Any:
    """Return the class of a type such as `px4_msgs/msg/VehicleStatus`, or None if it is not installed."""
    package, folder, name = ros_type.split("/")
    try:
        return getattr(import_module(f"{package}.{folder}"), name, None)
    except ImportError:
        return None


def spelled(field_type: str) -> str:
    """Return a type of a definition as rosidl spells it: `float[3]` for `float32[3]`, `sequence<uint8, 4>`."""
    base, bracket, length = field_type.partition("[")
    name, mark, most = base.partition("<=")
    item = _NAMES.get(name, name) + (f"<{most}>" if mark else "")
    length = length.removesuffix("]")
    if not bracket:
        return item
    if length.isdecimal():
        return f"{item}[{length}]"
    return f"sequence<{item}, {length.removeprefix('<=')}>" if length else f"sequence<{item}>"


def nested_classes(cls: type[Message]) -> Iterator[type[Message]]:
    """Yield the classes of the nested messages of a message class, without those inside them."""
    info = import_module(f"{package_of_class(cls).__name__}.info")
    for field in cls.__msg__.fields:
        if field.base[0].isupper() or "/" in field.base:
            yield info.nested_class(cls, field.base)


def differences(cls: type[Message], ros: type[RosType], find: Finder = installed) -> tuple[str, ...]:
    """Return how the fields of an installed type differ from those of a message class, () if they are the same.

    Names, types and the order of fields decide what bytes mean, and the type hash RIHS01 covers the same. Constants do
    not matter.
    """
    return tuple(_differences(cls, ros, find, ""))


def _differences(cls: type[Message], ros: type[RosType], find: Finder, path: str) -> Iterator[str]:
    own = {field.name: field for field in cls.__msg__.fields}
    theirs = dict(ros.get_fields_and_field_types())
    yield from (f"no field '{path}{name}'" for name in own if name not in theirs)
    yield from (f"a further field '{path}{name}'" for name in theirs if name not in own)
    if own.keys() == theirs.keys() and [*own] != [*theirs]:
        yield f"the fields{f' of {path[:-1]!r}' if path else ''} in another order"
    for name, field in own.items():
        found = theirs.get(name, "")
        nested = re.search(r"(\w+)/(\w+)", found)
        if nested is None:
            if found and found != spelled(field.type):
                yield f"'{path}{name}' is {found} instead of {spelled(field.type)}"
            continue
        part = find(f"{nested[1]}/msg/{nested[2]}")
        if found.replace(nested[0], field.base) != spelled(field.type) or part is None:
            yield f"'{path}{name}' is {found} instead of {spelled(field.type)}"
        else:
            info = import_module(f"{package_of_class(cls).__name__}.info")
            yield from _differences(info.nested_class(cls, field.base), part, find, f"{path}{name}.")
