"""The Python names of messages, fields and constants. The wire and all hashes use the names of the definition.

Underscores are appended to a name that Python or the generated class reserves, until it is free. Class names are
CamelCase, so that they do not clash with the names of fields.
"""

from __future__ import annotations

import keyword
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

from msggen.base.disk.resources import template_path
from msggen.definitions.enumeration import Enumeration
from msggen.definitions.identity import Endpoint
from msggen.definitions.model import Message, Service, snake_case

_OF_TEMPLATE = ("classmethod", "downgrade", "self", "upgrade")
"""The names that the template of a class uses or defines, in addition to the members of the base class."""

_OF_CLASSES = frozenset({*keyword.kwlist, "DecodeError", "EncodeError"})

_MEMBERS = (
    "as_integer_ratio bit_count bit_length conjugate denominator from_bytes imag is_integer mro name "
    "numerator real to_bytes value"
)
_OF_ENUMS = frozenset({*keyword.kwlist, *_MEMBERS.split()})
"""The names that no member of an IntEnum can have, in any version of Python."""


@lru_cache(maxsize=1)
def reserved_attributes() -> frozenset[str]:
    """Return the names that no attribute of a message can have: keywords and members of the base class."""
    members = [name for name in dir(_base_module().Message) if not name.startswith("_")]
    return frozenset({*keyword.kwlist, *_OF_TEMPLATE, *members})


def _base_module() -> ModuleType:
    """Import the support module with the base class. At run time, it imports only the standard library."""
    spec = spec_from_file_location("msggen_support_cdr", template_path("python/support/cdr.py"))
    if spec is None or spec.loader is None:
        raise ImportError("cannot import the support module cdr.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def module_name(name: str) -> str:
    """Return the module of the message or service `name`. The underscore avoids keywords and names of packages."""
    return f"_{snake_case(name)}"


def class_name(definition: Message | Service) -> str:
    """Return the class name of a message or service.

    It is `EscReport` for `EscReport` and for `esc_report`, and `None_` for `None`.
    """
    name = definition.name
    if isinstance(definition, Message) and definition.folder == "msg":
        name = "".join([f"{part[:1].upper()}{part[1:]}" for part in name.split("_")]) if _is_unusual(name) else name
    return f"{name}_" if name in _OF_CLASSES else name


def attribute_names(message: Message, classes: Collection[str] = ()) -> Mapping[str, str]:
    """Return the attribute of each field and constant of `message`, by name.

    `classes` are the classes in the module of `message`. Their names are avoided, because a type checker would confuse
    a constant of such a name with the class.
    """
    names = [*(field.name for field in message.fields), *(constant.name for constant in message.constants)]
    reserved = reserved_attributes()
    found = {name: name for name in names}
    for name in names:
        if name in reserved or name in classes:
            found[name] = free_name(name, {*names, *found.values(), *reserved, *classes})
    return found


def enum_names(enums: Sequence[Enumeration], taken: Collection[str]) -> Mapping[Enumeration, str]:
    """Return the class of each of `enums` in the class of their message; `taken` are the other names there."""
    found: dict[Enumeration, str] = {}
    used = {*taken, *reserved_attributes()}
    for enum in enums:
        found[enum] = free_name(enum.name, used)
        used.add(found[enum])
    return found


def member_names(names: Collection[str]) -> Mapping[str, str]:
    """Return the name of the member of an IntEnum or IntFlag for each of `names`."""
    found = {name: name for name in names}
    for name in names:
        if name in _OF_ENUMS or name[0] == name[-1] == "_":
            found[name] = free_name(name, {*names, *found.values(), *_OF_ENUMS})
    return found


def endpoint_attributes(endpoints: Sequence[Endpoint]) -> list[str]:
    """Return the attribute of each of `endpoints`, of one direction: the uORB topic and the instance, if it has one."""
    found: list[str] = []
    used = {*keyword.kwlist}
    for endpoint in endpoints:
        instance = endpoint.entry.instance
        found.append(free_name(f"{endpoint.entry.uorb_topic}{'' if instance is None else instance}", used))
        used.add(found[-1])
    return found


def _is_unusual(name: str) -> bool:
    return "_" in name or not name[:1].isupper()


def free_name(name: str, taken: Collection[str]) -> str:
    """Return `name`, with underscores appended until it is not in `taken`."""
    while name in taken:
        name += "_"
    return name
