"""Names of a definition as Python can have them; everything else, the wire and all hashes, keeps the definition's.

A name that Python or the generated class needs for itself gets an underscore behind it, and further ones until it is
free. Classes are CamelCase, so that none has the name of a field.
"""

from __future__ import annotations

import keyword
from collections.abc import Collection, Mapping

from msggen.model import Message, Service, snake_case

_OF_MESSAGES = frozenset(
    {
        *keyword.kwlist,
        "classmethod",
        "decode",
        "decode_batch",
        "downgrade",
        "dtype",
        "encode",
        "encode_batch",
        "from_row",
        "lazy",
        "self",
        "upgrade",
    }
)
"""What fields and constants cannot be called: the generated classes have these names for themselves, or will have."""

_OF_CLASSES = frozenset({*keyword.kwlist, "DecodeError", "EncodeError"})

_OF_ENUMS = frozenset(
    {
        *keyword.kwlist,
        "as_integer_ratio",
        "bit_count",
        "bit_length",
        "conjugate",
        "denominator",
        "from_bytes",
        "imag",
        "is_integer",
        "mro",
        "name",
        "numerator",
        "real",
        "to_bytes",
        "value",
    }
)
"""What the members of an IntEnum cannot be called."""


def module_name(name: str) -> str:
    """Return the module of the message or service `name`; the underscore keeps it apart from keywords and packages."""
    return f"_{snake_case(name)}"


def class_name(definition: Message | Service) -> str:
    """Return the class of a message or service: `EscReport` for `EscReport` and `esc_report`, `None_` for `None`."""
    name = definition.name
    if isinstance(definition, Message) and definition.folder == "msg":
        name = "".join([f"{part[:1].upper()}{part[1:]}" for part in name.split("_")]) if _is_unusual(name) else name
    return f"{name}_" if name in _OF_CLASSES else name


def attribute_names(message: Message, classes: Collection[str] = ()) -> Mapping[str, str]:
    """Return the attribute of each field and constant of `message`, by name.

    `classes` are those that the module of `message` has: type checkers would take a constant of that name for them.
    """
    names = [*(field.name for field in message.fields), *(constant.name for constant in message.constants)]
    found = {name: name for name in names}
    for name in names:
        if name in _OF_MESSAGES or name in classes:
            found[name] = _free(name, {*names, *found.values(), *_OF_MESSAGES, *classes})
    return found


def member_names(topics: Collection[str]) -> Mapping[str, str]:
    """Return the member of ORB_ID for each of `topics`, by name."""
    found = {topic: topic for topic in topics}
    for topic in topics:
        if topic in _OF_ENUMS or topic[0] == topic[-1] == "_":
            found[topic] = _free(topic, {*topics, *found.values(), *_OF_ENUMS})
    return found


def _is_unusual(name: str) -> bool:
    return "_" in name or not name[:1].isupper()


def _free(name: str, taken: Collection[str]) -> str:
    while name in taken:
        name += "_"
    return name
