"""The statements of `encode` and `decode` for a message with a static layout: one `struct` format for all values.

Python holds the values as follows (docs/design_inside.md has the measurements):

- one number or bool: itself
- `uint8[N]`, `char[N]`, `byte[N]`: bytes
- up to 15 numbers, or any number of bools: a tuple, unpacked through local variables, because `pack(*values)` would
  accept arrays of 4 and 2 values in place of two arrays of 3
- 16 or more numbers: array.array, copied as a block
- nested messages: flattened into the one `struct` format of the outer message
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.generate.python.formatting import joined_by, literal
from msggen.generate.python.kind import Kind, kind_of
from msggen.generate.python.names import attribute_names

ClassOf = Callable[[Message], str]
"""A function that returns the class name of a message in the module that nests it."""

_TAKEN = frozenset(
    {"bytes", "cls", "self", "data", "allow_surplus", "message", "header", "error", "len", "tuple", "type", "unpack"}
)
_LARGEST_GROUP = 100
"""The largest number of operands in a chain, because the compiler of Python recurses for each operator."""


class Names:
    """Unique names of local variables."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)

    def one(self, name: str) -> str:
        """Return `name`, with underscores appended until it is free."""
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def several(self, stem: str, count: int) -> list[str]:
        """Return a name for each element of an array."""
        return [self.one(f"{stem}_{index}") for index in range(count)]


class Values:
    """The expressions that one `struct` format packs and unpacks, in the order of the wire."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.targets: list[str] = []
        """The targets that `decode` unpacks to."""
        self.values: list[str] = []
        """The values that `encode` packs."""
        self.assigned: list[tuple[str, str]] = []
        """The attributes that `decode` assigns after it has unpacked, and their values."""
        self.unpacked: list[tuple[str, str]] = []
        """The local variables that `encode` unpacks attributes to before it packs, and the attributes."""
        self.sequences: list[str] = []
        """The attributes that must be sequences: unpacking would accept sets, dicts and bytes."""
        self.lengths: list[tuple[str, int]] = []
        """The attributes of bytes and their required lengths: `struct` would pad or truncate the bytes."""
        self.bools: list[str] = []
        """The values that must be bools: `struct` would accept any object."""

    def not_tuples(self, indent: int) -> str:
        """Return the condition that a sequence is not a tuple, as all are after decoding."""
        text = joined_by([f"type({attribute}) is not tuple" for attribute in self.sequences], " or ", indent)
        return f"({text})" if "\n" in text else text

    def groups_of_bools(self) -> list[list[str]]:
        """Return the bools in groups whose items are joined by an operator.

        Each group starts with `False`, because the operator would not be applied to a single value.
        """
        groups = (self.bools[index : index + _LARGEST_GROUP] for index in range(0, len(self.bools), _LARGEST_GROUP))
        return [["False", *group] for group in groups]

    def primitive(self, type_: FieldType, here: str, there: str, stem: str) -> None:
        """Add a primitive of fixed size, or an array of them, that is decoded to `here` and encoded from `there`."""
        kind = kind_of(type_)
        if kind is Kind.SCALAR:
            self.targets.append(here)
            self.values.append(there)
            self.bools += [there] if type_.name == "bool" else []
        elif kind is Kind.BYTES:
            self.targets.append(here)
            self.values.append(there)
            self.lengths.append((there, type_.length))
        elif kind is Kind.ARRAY:
            code = literal(PRIMITIVES[type_.name].code)
            raw = self.names.one(f"{stem}_raw")
            self.targets.append(raw)
            self.assigned.append((here, f"_from_raw({code}, {raw})"))
            self.values.append(f"_to_raw({code}, {type_.length}, {there})")
        else:
            names = self.names.several(stem, type_.length)
            self.targets += names
            self.assigned.append((here, as_tuple(names)))
            self.unpacked.append((as_tuple(names), there))
            self.sequences.append(there)
            self.values += names
            self.bools += names if type_.name == "bool" else []


class Codec(Values):
    """The statements of `encode` and `decode`."""

    def __init__(self, class_of: ClassOf) -> None:
        super().__init__(Names(_TAKEN))
        self.class_of = class_of
        self.created: list[tuple[str, str]] = []
        """The local variable and the class of each nested message that `decode` creates."""

    @classmethod
    def of(cls, catalog: Catalog, message: Message, class_of: ClassOf) -> Codec:
        """Return the statements for `message`, with its nested messages flattened.

        `class_of` returns the class name of a message.
        """
        codec = cls(class_of)
        codec._message(catalog, message, "message", "self", "")
        return codec

    def _message(self, catalog: Catalog, message: Message, decoded: str, encoded: str, stem: str) -> None:
        attributes = attribute_names(message)
        for inner in message.fields:
            name = attributes[inner.name]
            here, there = f"{decoded}.{name}", f"{encoded}.{name}"
            if inner.type.is_primitive:
                self.primitive(inner.type, here, there, stem + name)
            else:
                self._nested(catalog, catalog.nested(message, inner.type), inner.type, (here, there), stem + name)

    def _nested(
        self, catalog: Catalog, message: Message, type_: FieldType, attributes: tuple[str, str], stem: str
    ) -> None:
        here, there = attributes
        is_array = type_.array is ArrayKind.FIXED
        names = self.names.several(stem, type_.length) if is_array else [self.names.one(stem)]
        self.unpacked.append((as_tuple(names) if is_array else names[0], there))
        self.created += [(name, self.class_of(message)) for name in names]
        for name in names:
            self._message(catalog, message, name, name, f"{name}_")
        self.assigned.append((here, as_tuple(names) if is_array else names[0]))


def as_tuple(names: list[str]) -> str:
    """Return the expression of a tuple of `names`."""
    return f"({', '.join(names)}{',' if len(names) == 1 else ''})"
