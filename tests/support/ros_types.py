"""Message types as rclpy has them, made from definitions without ROS."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

NAMES = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}


def fields_of(definition: str, package: str = "px4_msgs") -> dict[str, str]:
    """Return the fields of a `ros2msg` definition as rosidl names their types.

    Written from the names that rosidl_generator_py puts into its classes, line by line.
    """
    fields = {}
    for line in definition.split("\n====", maxsplit=1)[0].splitlines():
        found = re.match(r"([\w/]+)(?:\[(\d*)\])? +(\w+)\s*(?:#|$)", line)
        if found:
            base, length, name = found.groups()
            is_message = base[0].isupper() or "/" in base
            shown = (base if "/" in base else f"{package}/{base}") if is_message else NAMES.get(base, base)
            fields[name] = shown if length is None else f"{shown}[{length}]" if length else f"sequence<{shown}>"
    return fields


def class_with(fields: dict[str, str], name: str = "Type") -> Any:
    """Return a class with the fields of a message type, without values."""
    return type(name, (), {"get_fields_and_field_types": classmethod(lambda _: dict(fields))})


def px4_msgs_of(messages: Iterable[Any], package: str = "px4_msgs") -> Callable[[str], Any]:
    """Return a finder of the types that a px4_msgs with the definitions of these classes has."""
    types: dict[str, Any] = {}
    for cls in messages:
        name = cls.__name__ if package != "px4_msgs" else cls.__msg__.ros_type.rpartition("/")[2]
        for part, text in parts_of(cls.__msg__.definition, name).items():
            types[f"{package}/msg/{part}"] = class_with(fields_of(text, package), part)
    return types.get


def services_of(*services: Any) -> Callable[[str], Any]:
    """Return a finder of these services of a package, and of their messages, as px4_msgs has them."""
    types: dict[str, Any] = {}
    for service in services:
        halves = {}
        for half in ("Request", "Response"):
            message = getattr(service, half)
            own, *nested = parts_of(message.__msg__.definition, half).items()
            halves[half] = class_with(fields_of(own[1]), half)
            types |= {f"px4_msgs/msg/{name}": class_with(fields_of(text), name) for name, text in nested}
        types[f"px4_msgs/srv/{service.__name__}"] = type(service.__name__, (), halves)
    return types.get


def parts_of(definition: str, name: str) -> dict[str, str]:
    """Return the texts of a `ros2msg` definition and its nested messages, by name."""
    first, *nested = re.split(r"^=+\nMSG: \w+/", definition, flags=re.MULTILINE)
    return {name: first, **{text.partition("\n")[0]: text.partition("\n")[2] for text in nested}}
