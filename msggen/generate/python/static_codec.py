"""The statements of `encode` and `decode` for a message with a static layout: one `struct` format has it all.

How a value is held in Python, and why (docs/design.md has the measurements):

- one number or bool: itself
- `uint8[N]`, `char[N]`, `byte[N]`: bytes
- up to 15 numbers, and bools: a tuple; its values are unpacked through locals, because `pack(*values)` would
  silently take a 4 and a 2 for two arrays of 3
- 16 numbers and more: array.array, copied as a block
- nested messages: unfolded into the one `struct` format of the outer message
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from msggen.generate.python.formatting import literal
from msggen.generate.python.kind import Kind, kind_of
from msggen.generate.python.names import attribute_names
from msggen.model import ArrayKind, Catalog, FieldType, Message
from msggen.primitives import PRIMITIVES

ClassOf = Callable[[Message], str]
"""Names the class of a message, as the module that nests it does."""

_TAKEN = frozenset({"cls", "self", "data", "allow_surplus", "message", "header", "error", "len"})
_LARGEST_GROUP = 100
"""Python compiles longer chains of operators by ever deeper recursion."""


class Names:
    """Names of locals, each given once."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)

    def one(self, name: str) -> str:
        """Return `name`, or one like it that is free."""
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def several(self, stem: str, count: int) -> list[str]:
        """Return a name for each element of an array."""
        return [self.one(f"{stem}_{index}") for index in range(count)]


class Values:
    """What one `struct` format packs and unpacks, as expressions in the order of the wire."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.targets: list[str] = []
        """What `decode` unpacks to."""
        self.values: list[str] = []
        """What `encode` packs."""
        self.assigned: list[tuple[str, str]] = []
        """Attribute and value of what `decode` puts together afterwards."""
        self.unpacked: list[tuple[str, str]] = []
        """Locals and attribute of what `encode` takes apart before."""
        self.lengths: list[tuple[str, int]] = []
        """Attributes of bytes, and how many there must be: `struct` would pad or cut them."""
        self.bools: list[str] = []
        """What must be a bool: `struct` would take any object for one."""

    def groups_of_bools(self) -> list[list[str]]:
        """Return the bools in groups that are joined by an operator, `False` first: alone it would not be applied."""
        groups = (self.bools[index : index + _LARGEST_GROUP] for index in range(0, len(self.bools), _LARGEST_GROUP))
        return [["False", *group] for group in groups]

    def primitive(self, type_: FieldType, here: str, there: str, stem: str) -> None:
        """Add a primitive of fixed size, or an array of them: decoded to `here`, encoded from `there`."""
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
            self.values += names
            self.bools += names if type_.name == "bool" else []


class Codec(Values):
    """The statements of `encode` and `decode`."""

    def __init__(self, class_of: ClassOf) -> None:
        super().__init__(Names(_TAKEN))
        self.class_of = class_of
        self.created: list[tuple[str, str]] = []
        """Local and class of the nested messages that `decode` makes."""

    @classmethod
    def of(cls, catalog: Catalog, message: Message, class_of: ClassOf) -> Codec:
        """Return the statements for `message`, with all it nests unfolded; `class_of` names the class of a message."""
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
    """Return a tuple of `names`."""
    return f"({', '.join(names)}{',' if len(names) == 1 else ''})"
