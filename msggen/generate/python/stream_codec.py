"""The statements of `encode` and `decode` for a message whose samples vary in size: strings, sequences, no fields.

A sample is read in steps. A step is a run of values of fixed size, which one `struct` format reads, and at most one
value after it with a size of its own. templates/python/support/stream.py has the functions that the statements call.

Python holds such values as follows: `string` and `wstring` as str; sequences of `uint8`, `char` and `byte` as bytes, of
other numbers as array.array, and of all other types as tuples; arrays as in messages with a static layout.
"""

from __future__ import annotations

from typing import NamedTuple

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message, snake_case
from msggen.definitions.primitives import PRIMITIVES, STRINGS
from msggen.generate.python.formatting import literal
from msggen.generate.python.kind import Kind, kind_of
from msggen.generate.python.names import attribute_names
from msggen.generate.python.static_codec import ClassOf, Names, Values

_TAKEN = frozenset({"bytes", "message", "data", "parts", "at", "wire", "run", "error", "len", "name", "tuple", "type"})

_DELIMITER, _COUNT, _NOTHING = "D", "I", "x"
"""The codes of a run that are not values: the delimiter header of XCDR2, a count, the byte of an empty message."""


class Call(NamedTuple):
    """A call of a function of templates/python/support/stream.py."""

    function: str
    arguments: tuple[str, ...]


class Step(Values):
    """A run of values, and the value of variable size after it."""

    def __init__(self, names: Names) -> None:
        super().__init__(names)
        self.codes = ""
        """The `struct` codes of the run."""
        self.fields: list[str] = []
        """The fields with values in the run."""
        self.taken_apart: list[tuple[str, str]] = []
        """The local variable and the attribute of each nested message whose fields `encode` reads."""
        self.created: list[tuple[str, str, str]] = []
        """The attribute, the local variable and the class of each nested message that `decode` creates.

        The local variable is "" for a message without fields.
        """
        self.prepared: list[tuple[str, Call]] = []
        """The local variables that `encode` sets before it packs the run, and their values."""
        self.target = ""
        """The attribute to which `decode` assigns the value after the run."""
        self.reader: Call | None = None
        """The call that reads that value; None after the last run."""
        self.writer: Call | None = None
        """The call that writes that value; None after the last run."""

    @property
    def arguments(self) -> tuple[str, str]:
        """The arguments of the run: its codes and its fields."""
        ends = dict.fromkeys([*self.fields[:1], *self.fields[-1:]])
        return literal(self.codes), literal(" to ".join(ends))


class Function(NamedTuple):
    """The functions that read and write a message."""

    name: str
    cls: str
    runs: str
    steps: tuple[Step, ...]


def functions_of(catalog: Catalog, message: Message, class_of: ClassOf) -> tuple[Function, ...]:
    """Return the functions for `message`, after those for the messages in its arrays and sequences.

    `class_of` returns the class name of a message.
    """
    found: dict[str, Function] = {}
    _Walk(catalog, class_of, found).function(message)
    return tuple(found.values())


class _Place(NamedTuple):
    """A field: its attribute, the prefix of its local variables, and its path from the outermost message."""

    attribute: str
    stem: str
    path: str

    def inside(self, local: str) -> _Place:
        """Return the place of a nested message that the local variable `local` holds."""
        return _Place(local, f"{local}_", f"{self.path}.")

    def field(self, name: str, attribute: str) -> _Place:
        """Return the place of a field of the message at this place."""
        return _Place(f"{self.attribute}.{attribute}", self.stem + attribute, self.path + name)


class _Walk:
    """A walk over the fields of a message in the order of the wire."""

    def __init__(self, catalog: Catalog, class_of: ClassOf, found: dict[str, Function]) -> None:
        self.catalog = catalog
        self.class_of = class_of
        self.found = found
        self.names = Names(_TAKEN)
        self.steps = [Step(self.names)]

    def function(self, message: Message) -> str:
        """Add the functions of `message` if they are missing, and return their name."""
        if message.key not in self.found:
            cls = self.class_of(message)
            walk = _Walk(self.catalog, self.class_of, self.found)
            walk.message(message, _Place("message", "", ""))
            steps = walk.steps if walk.step.codes else walk.steps[:-1]
            name = snake_case(cls)
            self.found[message.key] = Function(name, cls, f"_{name.upper()}_RUN", tuple(steps))
        return self.found[message.key].name

    @property
    def step(self) -> Step:
        """The current step."""
        return self.steps[-1]

    def message(self, message: Message, outer: _Place) -> None:
        """Add the fields of `message`."""
        if not message.fields:
            self._run(_NOTHING, outer.path.rstrip("."))
        attributes = attribute_names(message)
        for field in message.fields:
            place, type_ = outer.field(field.name, attributes[field.name]), field.type
            if not type_.is_primitive:
                self._nested(self.catalog.nested(message, type_), type_, place)
            elif type_.is_fixed_size and kind_of(type_) is not Kind.ARRAY:
                is_block = kind_of(type_) is Kind.BYTES
                self._run("s" if is_block else PRIMITIVES[type_.name].code, place.path, type_.element_count)
                self.step.primitive(type_, place.attribute, place.attribute, place.stem)
            else:
                self._primitive(type_, place)

    def _run(self, code: str, path: str, count: int = 1) -> None:
        self.step.codes += code if count == 1 and code != "s" else f"{count}{code}"
        self.step.fields.append(path)

    def _nested(self, inner: Message, type_: FieldType, place: _Place) -> None:
        cls = self.class_of(inner)
        if type_.array is ArrayKind.SCALAR:
            local = self.names.one(place.stem) if inner.fields else ""
            self.step.created.append((place.attribute, local, cls))
            if local:
                self.step.taken_apart.append((local, place.attribute))
            else:  # check the class, because no field would reveal a value of another type
                one = _call("instances", f"({place.attribute},)", "wire", cls)
                self.step.prepared.append((self.names.one(f"_{place.stem}"), one))
            self.message(inner, place.inside(local))
            return
        name = self.function(inner)
        values = self._prepared(place, "instances", cls, _number_of(type_))
        self._elements(type_, place, values, ("messages", cls, f"_read_{name}"), f"_write_{name}")

    def _primitive(self, type_: FieldType, place: _Place) -> None:
        """Add a primitive of variable size, or a large array: a block between two runs."""
        if type_.name in STRINGS:
            bound = "" if type_.string_bound is None else f"bound={type_.string_bound}"
            kind = "text" if type_.name == "string" else "wide_text"
            if type_.array is ArrayKind.SCALAR:
                size = 1 if kind == "text" else PRIMITIVES["uint32"].size
                self._block(place, self._prepared(place, f"{kind}_bytes", bound), size, (kind, bound))
            else:
                values = self._prepared(place, f"{kind}s_bytes", _number_of(type_), bound)
                self._elements(type_, place, values, (f"{kind}s", bound))
        elif kind_of(type_) is not Kind.ARRAY:
            kind = "octets" if kind_of(type_) is Kind.BYTES else "bools"
            most = _number_of(type_)
            self._block(place, self._prepared(place, f"{kind}_bytes", most), 1, (kind, most))
        else:
            self._numbers(type_, place)

    def _numbers(self, type_: FieldType, place: _Place) -> None:
        primitive, number = PRIMITIVES[type_.name], _number_of(type_)
        code, size = literal(primitive.code), primitive.size
        raw = self._prepared(place, "number_bytes", code, number)
        if type_.array is ArrayKind.FIXED:
            reader = _call("numbers", "data", _END, str(type_.length), "wire", literal(place.path), code)
            self._close(place, reader, _call("put_aligned", raw, "parts", _END, "wire", str(size)))
        else:
            self._block(place, raw, size, ("numbers", code, number))

    def _block(self, place: _Place, raw: str, size: int, reader: tuple[str, ...]) -> None:
        """Add a block of bytes after the count of its values, which have `size` bytes each."""
        count = self._count(place, f"len({raw})" if size == 1 else f"len({raw}) // {size}")
        function, *more = reader
        put = (
            ("put", raw, "parts", _END)
            if size <= PRIMITIVES["uint32"].size
            else ("put_aligned", raw, "parts", _END, "wire", str(size))
        )
        self._close(place, _call(function, "data", _END, count, "wire", literal(place.path), *more), _call(*put))

    def _elements(self, type_: FieldType, place: _Place, values: str, reader: tuple[str, ...], *writer: str) -> None:
        """Add elements that are not primitive. In XCDR2, a delimiter header precedes them and their count."""
        self._run(_DELIMITER, place.path)
        is_fixed = type_.array is ArrayKind.FIXED
        count = str(type_.length) if is_fixed else self._count(place, f"len({values})")
        lead = "4" if is_fixed else "8"
        function, *more = reader
        most = "" if is_fixed else _number_of(type_)
        read = _call(function, "data", _END, count, "wire", literal(place.path), lead, *more, most)
        self._close(place, read, _call(f"put_{function}", values, "parts", _END, "wire", lead, *writer))

    def _count(self, place: _Place, value: str) -> str:
        """Add a count to the run, and return the local variable that it is read into."""
        local = self.names.one(f"{place.stem}_count")
        self._run(_COUNT, place.path)
        self.step.targets.append(local)
        self.step.values.append(value)
        return local

    def _prepared(self, place: _Place, function: str, *more: str) -> str:
        """Return the local variable for the value that `encode` prepares before it packs the run."""
        local = self.names.one(f"{place.stem}_raw")
        self.step.prepared.append((local, _call(function, place.attribute, "wire", *more)))
        return local

    def _close(self, place: _Place, reader: Call, writer: Call) -> None:
        self.step.target, self.step.reader, self.step.writer = place.attribute, reader, writer
        self.steps.append(Step(self.names))


_END = "at + run.size"


def _call(function: str, *arguments: str) -> Call:
    """Return a call without the empty arguments."""
    return Call(function, tuple(filter(None, arguments)))


def _number_of(type_: FieldType) -> str:
    """Return the argument with the exact or the largest number of values, or ""."""
    if type_.array is ArrayKind.FIXED:
        return f"exactly={type_.length}"
    return f"most={type_.length}" if type_.array is ArrayKind.BOUNDED else ""
