"""Random ROS 2 definitions, as texts of `.msg` and `.srv` files, and random values for their messages.

Everything follows from a seed, so that a failure can be repeated. Error-prone definitions are frequent: small types
before large ones, nested messages that end unaligned, no elements, one element, and as many as the bound allows.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES, STRINGS
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions

NUMBERS = ("bool", *INTEGERS, *FLOATS)
LENGTHS = (1, 1, 2, 2, 3, 3, 4, 5, 7, 8, 15, 16, 17, 33)
BOUNDS = (1, 2, 3, 7, 16, 100, 65535, 65536, 2**31 - 1)
NAMES = (
    *("array", "body", "buffer", "bytes", "cdr", "count", "data", "end", "error", "header", "index", "int", "item"),
    *("length", "list", "message", "name", "new", "offset", "order", "pack", "position", "raw", "sample", "size"),
    *("start", "str", "struct", "tuple", "type", "unpack", "value", "values", "version", "view", "x", "y", "z", "zip"),
)
"""Field names that code for messages might use itself."""

TEXTS = (
    "",
    "a",
    "ab",
    "abc",
    "map",
    "x" * 7,
    "é",
    "Übergröße",
    "日本語",
    "😀",
    "a😀b",
    "\0",
    "a\0b",
    "\uffff",
    "€" * 9,
)
SPELLED = ("", "a", "two words", "it's", 'say "so"', "é", "# [1, 2]")
"""Texts for constants and defaults, in which quotes, brackets and `#` have a meaning."""

PACKAGES = ("px4_msgs", "other_msgs")

TOLERATED = ("M103", "M401")
"""Errors that uORB reports and ROS 2 does not: messages without fields, and without a timestamp."""

HEAVY = 300
"""The most values that a nested message holds."""


def random_catalog(
    folder: Path, chance: Random, messages: int, services: int = 0, strings: Sequence[str] = STRINGS
) -> Catalog:
    """Write that many definitions into `folder`, and return the catalog that msggen reads from it.

    The definitions are spread over PACKAGES, which have messages with the same names, and later ones nest earlier ones.
    Their string types are those in `strings`.
    """
    author = _Author(chance, strings)
    for _ in range(messages):
        package = chance.choice(PACKAGES)
        name = f"Message{sum(key.startswith(package) for key in author.weights)}"
        text, author.weights[f"{package}/{name}"] = author.body(package)
        write_definitions(folder / package, {f"msg/{name}.msg": text})
    for number in range(services):
        package = chance.choice(PACKAGES)
        text = f"{author.body(package)[0]}---\n{author.body(package)[0]}"
        write_definitions(folder / package, {f"srv/Service{number}.srv": text})
    own, other = PACKAGES
    return read_catalog(find_sources(str(folder / own), (f"{other}={folder / other}",)), tolerated=TOLERATED)


class _Author:
    """Writes definitions; `weights` has the approximate number of values in each message."""

    def __init__(self, chance: Random, strings: Sequence[str]) -> None:
        self.chance = chance
        self.strings = strings
        self.weights: dict[str, int] = {}

    def body(self, package: str) -> tuple[str, int]:
        """Return a message of `package`, and the approximate number of its values."""
        chance = self.chance
        names = chance.sample(NAMES, chance.choice((0, 1, 1, 2, 2, 3, 3, 4, 5, 8)))
        names = [name if chance.random() < 0.5 else f"field{index}" for index, name in enumerate(names)]
        lines, weight = [], 1
        for name in names:
            type_, of_field = self.type(package)
            lines.append(f"{type_} {name}{self.default(type_)}\n")
            weight += of_field
        for number in range(chance.choice((0, 0, 0, 1, 2))):
            type_ = chance.choice((*NUMBERS, "string"))
            lines.append(f"{type_} CONSTANT_{number} = {self.literal(type_)}\n")
        chance.shuffle(lines)
        return "".join(lines), weight

    def type(self, package: str) -> tuple[str, int]:
        """Return a type, and the approximate number of its values."""
        chance = self.chance
        base, weight = self.base(package)
        kind = chance.random()
        if kind < 0.45:
            return base, weight
        if kind < 0.65:
            length = chance.choice(LENGTHS if weight == 1 else LENGTHS[:6])
            return f"{base}[{length}]", weight * length
        return f"{base}[<={chance.choice(BOUNDS)}]" if kind < 0.8 else f"{base}[]", weight * 2

    def base(self, package: str) -> tuple[str, int]:
        chance = self.chance
        nestable = [key for key, weight in self.weights.items() if weight <= HEAVY]
        kind = chance.random()
        if kind < 0.3 and nestable:
            key = chance.choice(nestable[-12:])
            is_bare = key.startswith(package) and chance.random() < 0.8
            return key.removeprefix(f"{package}/") if is_bare else key, self.weights[key]
        if kind < 0.8:
            return chance.choice(NUMBERS), 1
        bound = f"<={chance.choice(BOUNDS)}" if chance.random() < 0.4 else ""
        return f"{chance.choice(self.strings)}{bound}", 1

    def default(self, type_: str) -> str:
        """Return a default with the space before it, or an empty string."""
        chance = self.chance
        base, bracket, length = type_.partition("[")
        if base.partition("<=")[0] not in (*NUMBERS, *STRINGS) or chance.random() < 0.7:
            return ""
        if not bracket:
            return f" {self.literal(base)}"
        most = int(length.strip("<=]") or 3)
        count = most if length[:1].isdecimal() else min(most, chance.choice((0, 1, 3)))
        return f" [{', '.join(self.literal(base) for _ in range(count))}]"

    def literal(self, type_: str) -> str:
        """Return a value of a primitive in the spelling of definitions."""
        chance = self.chance
        name, _, bound = type_.partition("<=")
        if name in STRINGS:
            quote = chance.choice("\"'")
            text = chance.choice(SPELLED)[: int(bound or 9)]
            return quote + text.replace(quote, f"\\{quote}") + quote
        if name == "bool":
            return chance.choice(("true", "false", "1", "0"))
        if name in FLOATS:
            return chance.choice(("0", "1.5", "-0.25", "1e3"))
        return str(_integer(chance, name))


def values_of(catalog: Catalog, message: Message, chance: Random) -> dict[str, Any]:
    """Return random values for `message`, in the form that reference.py takes."""

    def one(type_: FieldType) -> Any:
        if type_.name in STRINGS:
            return _text(chance, type_.string_bound)
        return (
            _number(chance, type_.name)
            if type_.is_primitive
            else values_of(catalog, catalog.nested(message, type_), chance)
        )

    def several(type_: FieldType) -> Any:
        return one(type_) if type_.array is ArrayKind.SCALAR else [one(type_) for _ in range(_count(chance, type_))]

    return {field.name: several(field.type) for field in message.fields}


def _count(chance: Random, type_: FieldType) -> int:
    if type_.array is ArrayKind.FIXED:
        return type_.length
    counts = (0, 0, 1, 2, 3, 5, 17, 1000 if chance.random() < 0.2 else 100) if type_.name in NUMBERS else (0, 0, 1, 2)
    count = chance.choice(counts)
    return min(count, type_.length) if type_.array is ArrayKind.BOUNDED else count


def _number(chance: Random, name: str) -> Any:
    if name == "bool":
        return chance.random() < 0.5
    if name in INTEGERS:
        return _integer(chance, name)
    code, size = {"float32": ("<f", 4), "float64": ("<d", 8)}[name]
    (any_bits,) = struct.unpack(code, chance.randbytes(size))
    value = chance.choice((0.0, -0.0, 1.5, math.inf, -math.inf, math.nan, any_bits, any_bits))
    return math.nan if math.isnan(value) else value  # Python does not keep the bits of a NaN


def _integer(chance: Random, name: str) -> int:
    low, high = PRIMITIVES[name].integer_range
    return chance.choice((0, 1, low, high, chance.randint(low, high)))


def _text(chance: Random, bound: int | None) -> str:
    """Return a text within the bound in any unit: characters, UTF-8 bytes or UTF-16 code units."""
    if bound is not None and bound <= 100 and chance.random() < 0.2:
        return "x" * bound
    text = chance.choice(TEXTS) * (100 if chance.random() < 0.05 else 1)
    while bound is not None and len(text.encode()) > bound:
        text = text[: len(text) // 2]
    return text
