"""Codecs that test_peers.py compares with reference.py: those of the generated package, rosbags and pycdr2.

Each accepts and returns values like reference.py. CANNOT lists everything that a peer does not support.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Protocol

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from support.catalogs import import_package
from support.reference import HEADERS, Values, to_object, to_values

CANNOT = {
    ("rosbags", "wstring"): "it parses the type, and has no code for it",
    ("pycdr2", "wstring"): "it has no such type",
    ("rosbags", "XCDR2"): "it writes none, and refuses the headers",
}
"""Types and encodings not compared with a peer, with the reason. For wstring, vectors/rclpy.json has rclpy's bytes."""

USUAL = ("little", 1)

pycdr2: Any = importlib.import_module("pycdr2")  # Any, because its annotations do not allow this use of its classes
types: Any = importlib.import_module("pycdr2.types")


def everything(catalog: Catalog) -> list[Message]:
    """Return the messages of `catalog`, then both halves of each service."""
    halves = [half for service in catalog.services for half in (service.request, service.response)]
    return [*catalog.messages.values(), *halves]


class Codec(Protocol):
    """Encodes values as samples and decodes samples."""

    encodings: tuple[tuple[str, int], ...]

    def encode(self, message: Message, values: Values, order: str, version: int) -> bytes: ...

    def decode(self, message: Message, sample: bytes) -> Values: ...


class Generated:
    """The package that msggen generates."""

    encodings = tuple(HEADERS)

    def __init__(self, catalog: Catalog, package: ModuleType) -> None:
        self.catalog = catalog
        self.encode_as = importlib.import_module(f"{package.__name__}.encapsulation").encode_as
        self.errors = importlib.import_module(f"{package.__name__}.cdr")
        self.types = SimpleNamespace()
        for message in everything(catalog):
            is_own = message.package == catalog.package
            home = package.__name__ if is_own else f"{package.__name__}.{message.package}"
            module = importlib.import_module(f"{home}.{message.folder}")
            if is_own:
                setattr(self.types, message.name, getattr(module, message.name))
            else:
                setattr(self.types, message.package, importlib.import_module(home))

    def encode(self, message: Message, values: Values, order: str, version: int) -> bytes:
        given = to_object(self.types, self.catalog, message, values)
        is_usual = (order, version) == USUAL
        encoded: bytes = given.encode() if is_usual else self.encode_as(given, HEADERS[order, version][:2])
        return encoded

    def decode(self, message: Message, sample: bytes) -> Values:
        return to_values(self.catalog, message, self.cls(message).decode(sample))

    def cls(self, message: Message) -> Any:
        """Return the class of a message."""
        is_own = message.package == self.catalog.package
        home = self.types if is_own else getattr(getattr(self.types, message.package), message.folder)
        return getattr(home, message.name)


@contextmanager
def generated(catalog: Catalog, folder: Path) -> Iterator[Generated]:
    """Generate the package of `catalog` in `folder`, import it, and remove its modules at the end."""
    package = import_package(catalog, folder)
    try:
        yield Generated(catalog, package)
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == package.__name__]:
            del sys.modules[name]


class Rosbags:
    """Parses the same texts with its own parser. Its `byte` is signed."""

    encodings = tuple(encoding for encoding in HEADERS if encoding[1] == 1)

    def __init__(self, catalog: Catalog) -> None:
        self.catalog = catalog
        self.store = get_typestore(Stores.EMPTY)
        found: dict[str, Any] = {}
        for name, text in _texts(catalog):
            found |= get_types_from_msg(text, name)
        self.store.register(found)

    def encode(self, message: Message, values: Values, order: str, version: int) -> bytes:
        assert version == 1
        given = self._object(message, values)
        return bytes(self.store.serialize_cdr(given, _name(message), little_endian=order == "little"))

    def decode(self, message: Message, sample: bytes) -> Values:
        return self._values(message, self.store.deserialize_cdr(sample, _name(message)))

    def _object(self, message: Message, values: Values) -> Any:
        def one(type_: FieldType, value: Any) -> Any:
            if not type_.is_primitive:
                return self._object(self.catalog.nested(message, type_), value)
            return value - 256 if type_.name == "byte" and value > 127 else value

        def several(type_: FieldType, value: Any) -> Any:
            if type_.array is ArrayKind.SCALAR:
                return one(type_, value)
            if not type_.is_primitive or type_.name == "string":
                return [one(type_, item) for item in value]
            return np.array(value, {"byte": "uint8", "char": "uint8"}.get(type_.name, type_.name))

        arguments = [several(field.type, values[field.name]) for field in message.fields]
        return self.store.types[_name(message)](*arguments)

    def _values(self, message: Message, given: Any) -> Values:
        def one(type_: FieldType, value: Any) -> Any:
            if not type_.is_primitive:
                return self._values(self.catalog.nested(message, type_), value)
            return value % 256 if type_.name == "byte" else value

        def several(type_: FieldType, value: Any) -> Any:
            if type_.array is ArrayKind.SCALAR:
                return one(type_, value)
            return [one(type_, item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]

        return {field.name: several(field.type, getattr(given, field.name)) for field in message.fields}


def _texts(catalog: Catalog) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each definition, with the halves of services as separate messages."""
    for message in catalog.messages.values():
        yield _name(message), Path(message.location.path).read_text(encoding="utf-8")
    for service in catalog.services:
        halves = Path(service.location.path).read_text(encoding="utf-8").split("---\n")
        yield from zip([_name(service.request), _name(service.response)], halves, strict=True)


def _name(message: Message) -> str:
    """Return the name of a message in rosbags, which does not support services."""
    return f"{message.package}/msg/{message.name}"


class Pycdr2:
    """Uses classes with the same fields. It has no `byte`, and its `char` is a string, so both are uint8 here."""

    encodings = tuple(HEADERS)

    def __init__(self, catalog: Catalog) -> None:
        self.catalog = catalog
        self.classes: dict[str, Any] = {}

    def encode(self, message: Message, values: Values, order: str, version: int) -> bytes:
        endianness = {"big": pycdr2.Endianness.Big, "little": pycdr2.Endianness.Little}[order]
        encoded: bytes = self._object(message, values).serialize(use_version_2=version == 2, endianness=endianness)
        return encoded

    def decode(self, message: Message, sample: bytes) -> Values:
        return self._values(message, self._class(message).deserialize(sample))

    def _class(self, message: Message) -> Any:
        if message.key not in self.classes:
            annotations = {field.name: self._type(message, field.type) for field in message.fields}
            body = {"__annotations__": annotations or {"structure_needs_at_least_one_member": types.uint8}}
            made = type(pycdr2.IdlStruct)(message.name, (pycdr2.IdlStruct,), body)
            self.classes[message.key] = dataclass(made)
        return self.classes[message.key]

    def _type(self, outer: Message, type_: FieldType) -> Any:
        if not type_.is_primitive:
            one = self._class(self.catalog.nested(outer, type_))
        elif type_.name == "string":
            one = str if type_.string_bound is None else types.bounded_str[type_.string_bound]
        elif type_.name in ("bool", "byte", "char"):
            one = {"bool": bool}.get(type_.name, types.uint8)
        else:
            one = getattr(types, type_.name)
        if type_.array is ArrayKind.SCALAR:
            return one
        if type_.array is ArrayKind.FIXED:
            return types.array[one, type_.length]
        is_bounded = type_.array is ArrayKind.BOUNDED and type_.length <= 65535  # pycdr2 has no type for higher bounds
        return types.sequence[one, type_.length] if is_bounded else types.sequence[one]

    def _object(self, message: Message, values: Values) -> Any:
        def one(type_: FieldType, value: Any) -> Any:
            return value if type_.is_primitive else self._object(self.catalog.nested(message, type_), value)

        def several(type_: FieldType, value: Any) -> Any:
            if type_.array is ArrayKind.SCALAR:
                return one(type_, value)
            is_bytes = type_.array is ArrayKind.FIXED and type_.name in ("uint8", "byte", "char")
            return bytes(value) if is_bytes else [one(type_, item) for item in value]

        arguments = [several(field.type, values[field.name]) for field in message.fields]
        return self._class(message)(*(arguments or [0]))

    def _values(self, message: Message, given: Any) -> Values:
        def one(type_: FieldType, value: Any) -> Any:
            return value if type_.is_primitive else self._values(self.catalog.nested(message, type_), value)

        def several(type_: FieldType, value: Any) -> Any:
            is_scalar = type_.array is ArrayKind.SCALAR
            return one(type_, value) if is_scalar else [one(type_, item) for item in value]

        return {field.name: several(field.type, getattr(given, field.name)) for field in message.fields}
