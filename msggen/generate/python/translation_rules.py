"""The rules by which one version of a message is made from another, their values, and their Python source."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from struct import pack, unpack
from typing import NamedTuple

from msggen.definitions.model import ArrayKind, Field, FieldType, Value
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES
from msggen.definitions.translation import CHOICE, PREDICATES, Expression, Number, Operation, Place
from msggen.generate.python.formatting import joined_by, literal, wrapped

BOOL, INTEGER, FLOAT = "bool", "integer", "float"
KINDS = {"bool": BOOL, **dict.fromkeys(INTEGERS, INTEGER), **dict.fromkeys(FLOATS, FLOAT)}
"""The kind of each primitive type."""

_PROMOTED_BELOW = 2**31
"""C++ promotes an integer to `int` before a comparison if all values of its type are below this number."""

EACH = "i"
"""The variable for the index of an element in the value of a part."""

_PYTHON = {"&&": "and", "||": "or"}
_BINDING = {CHOICE: 0, "||": 1, "&&": 2, "!": 3, **dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), 4)}
_LONG = 80
"""The length from which an expression is written on lines of its own."""


class Copied(NamedTuple):
    """A rule for a field that gets the value of a field with another name."""

    field: str
    source: str

    @property
    def code(self) -> str:
        """The rule in the generated table."""
        return f"Copied({literal(self.field)}, {literal(self.source)})"

    @property
    def documentation(self) -> str:
        """The rule in the docstring of the method."""
        return f"`{self.field}` from `{self.source}`"


class Part(NamedTuple):
    """A range of elements, from `start` up to `stop`, and their value."""

    start: int
    stop: int
    value: Expression


class Computed(NamedTuple):
    """A rule for a field whose value is computed. Each part of an array has a value.

    `rest` are the defaults, which all other elements keep.
    """

    field: str
    type: FieldType
    parts: tuple[Part, ...]
    rest: tuple[Value, ...]
    source: str
    """The name of the source message in the code: "older" or "newer"."""

    @property
    def reads(self) -> tuple[str, ...]:
        """The fields that the value is computed from."""
        return tuple(dict.fromkeys(place.field for part in self.parts for place in places_of(part.value)))

    @property
    def unset(self) -> tuple[str, ...]:
        """The elements that get no value."""
        return tuple(
            element_slice(self.field, start, stop)
            for start, stop, value in self._every()
            if not isinstance(value, Expression)
        )

    @property
    def code(self) -> str:
        """The rule in the generated table."""
        value = self.parts[0].value
        if self.type.array is ArrayKind.SCALAR and isinstance(value, Number):
            return f"Constant({literal(self.field)}, {_python(value, '')})"
        unset = f"({wrapped(map(literal, self.unset), 12, 'tuple')})"
        items = [
            literal(self.field),
            f"({wrapped(map(literal, self.reads), 12, 'tuple')})",
            f"lambda {self.source if self.reads else '_'}: {self._value()}",
            *([f"defaulted={unset}"] if self.unset else []),
        ]
        return f"Computed({wrapped(items, 12)})"

    @property
    def documentation(self) -> str:
        """The rule in the docstring of the method."""
        return ", ".join(self._describe(part) for part in self.parts)

    def _describe(self, part: Part) -> str:
        name = self.field if self.type.array is ArrayKind.SCALAR else element_slice(self.field, part.start, part.stop)
        value = part.value
        if isinstance(value, Place) and value.path[0].element == EACH:
            return f"`{name}` from `{element_slice(value.field, part.start, part.stop)}`"
        if isinstance(value, Number):
            return f"`{name}` = {_python(value)}"
        return f"`{name}` = `{_python(value)}`"

    def _value(self) -> str:
        if self.type.array is ArrayKind.SCALAR:
            text = _python(self.parts[0].value, f"{self.source}.")
            return text if len(text) < _LONG else f"({joined_by(text.split(' '), ' ', 16)})"
        rows = list(self._every())
        pieces = [self._elements(*row) for row in rows]
        if len(pieces) == 1:
            return pieces[0]
        return f"({wrapped([f'*{piece}' for piece in pieces], 16, 'tuple')})"

    def _every(self) -> Iterator[tuple[int, int, Expression | tuple[Value, ...]]]:
        """Yield all elements in ranges: those with a value and their value, all others and their defaults."""
        position = 0
        for start, stop, value in (*self.parts, (self.type.length, self.type.length, ())):
            if position < start:
                yield position, start, self.rest[position:start]
            if start < stop:
                yield start, stop, value
            position = stop

    def _elements(self, start: int, stop: int, value: Expression | tuple[Value, ...]) -> str:
        if not isinstance(value, Expression):
            same = len(set(map(repr, value))) == 1
            return f"({literal(value[0])},) * {len(value)}" if same else literal(value)
        if isinstance(value, Place) and value.path[0].element == EACH:
            return f"{self.source}.{value.field}[{start}:{stop}]"
        text = _python(value, f"{self.source}.")
        if any(place.path[0].element == EACH for place in places_of(value)):
            return f"[{text} for {EACH} in range({start}, {stop})]"
        return f"({text},)" + (f" * {stop - start}" if stop - start > 1 else "")


class Unread(NamedTuple):
    """A rule for a field without a value: it is unclear in the header, or the field cannot hold it."""

    field: str

    @property
    def code(self) -> str:
        """The rule in the generated table."""
        return f"Unread({literal(self.field)})"

    @property
    def documentation(self) -> str:
        """The rule in the docstring of the method."""
        return f"`{self.field}` keeps its default: the statement could not be parsed"


Rule = Copied | Computed | Unread


def places_of(value: Expression) -> Iterator[Place]:
    """Yield the fields that a value is computed from."""
    if isinstance(value, Place):
        yield value
    elif isinstance(value, Operation):
        for operand in value.operands:
            yield from places_of(operand)


def element_slice(name: str, start: int, stop: int) -> str:
    """Return a range of elements of the field `name` as Python: `control[8:15]`, or `control[8]` for one element."""
    return f"{name}[{start}]" if stop - start == 1 else f"{name}[{start}:{stop}]"


def _python(value: Expression, prefix: str | None = None, least: int = 0) -> str:
    """Return `value` as Python code with `prefix` before the fields, or without a prefix for documentation.

    If the operator binds more weakly than `least`, the text has parentheses.
    """
    if isinstance(value, Number):
        return _number(value, is_code=prefix is not None)
    if isinstance(value, Place):
        name, element = value.path[0]
        return f"{prefix or ''}{name}" + ("" if element is None else f"[{element}]")
    if value.operator in PREDICATES:
        return f"{value.operator}({_python(value.operands[0], prefix)})"
    binding = _BINDING[value.operator]
    if value.operator == CHOICE:
        condition, one = (_python(operand, prefix, binding + 1) for operand in value.operands[:2])
        other = _python(value.operands[2], prefix, binding)
        text = f"{one} if {condition} else {other}"
    elif value.operator == "!":
        text = f"not {_python(value.operands[0], prefix, binding)}"
    else:
        left = binding + 1 if binding == _BINDING["<"] else binding
        one, other = _python(value.operands[0], prefix, left), _python(value.operands[1], prefix, binding + 1)
        text = f"{one} {_PYTHON.get(value.operator, value.operator)} {other}"
    return f"({text})" if binding < least else text


def _number(number: Number, *, is_code: bool) -> str:
    value = number.value
    if number.name and not is_code:
        return number.name
    if isinstance(value, float) and not is_code:
        return _short(value)
    return str(value) if isinstance(value, float) and not math.isfinite(value) else repr(value)


def _short(value: float) -> str:
    """Return `value` with the fewest digits that identify it as a float32, or as a float64 if it is not a float32."""
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else str(value)
    for digits in range(1, 10):
        text = f"{value:.{digits}g}"
        with suppress(OverflowError):
            if unpack("<f", pack("<f", float(text)))[0] == value:
                return repr(float(text))
    return repr(value)


class UnclearError(ValueError):
    """A value that does not fit, or that cannot be determined from the definitions."""


def fitted(value: Expression, type_: FieldType, mine: Mapping[str, Field]) -> Expression:
    """Return `value`, with constants converted to `type_`. `mine` are the fields of the source.

    Raises UnclearError if a field of `type_` does not hold the value.
    """
    kind = KINDS[type_.name]
    if isinstance(value, Number):
        return value._replace(value=_converted(value.value, type_))
    if isinstance(value, Operation) and value.operator == CHOICE:
        condition, one, other = value.operands
        if kind_of_value(condition, mine) != BOOL:
            raise UnclearError
        return Operation(CHOICE, (condition, fitted(one, type_, mine), fitted(other, type_, mine)))
    if kind_of_value(value, mine) != kind:
        raise UnclearError
    return value


def _converted(value: float | None, type_: FieldType) -> bool | int | float:
    """Return a constant as a value of `type_`. Raises UnclearError if the conversion does more than round a float."""
    if value is None:
        raise UnclearError
    if type_.name == "bool":
        if value not in (0, 1):
            raise UnclearError
        return bool(value)
    if type_.name in INTEGERS:
        low, high = PRIMITIVES[type_.name].integer_range
        if not low <= value <= high or value != int(value):
            raise UnclearError
        return int(value)
    try:
        return float(unpack("<f", pack("<f", value))[0]) if type_.name == "float32" else float(value)
    except OverflowError:
        raise UnclearError from None


def kind_of_value(value: Expression, mine: Mapping[str, Field]) -> str:
    """Return the kind of an expression's value. Raises UnclearError if C++ and Python may evaluate it differently."""
    if isinstance(value, Number):
        return BOOL if isinstance(value.value, bool) else INTEGER if isinstance(value.value, int) else FLOAT
    if isinstance(value, Place):
        return KINDS[mine[value.field].type.name]
    kinds = [kind_of_value(operand, mine) for operand in value.operands]
    if value.operator == CHOICE:
        if kinds[0] != BOOL or kinds[1] != kinds[2]:
            raise UnclearError
        return kinds[1]
    if value.operator in PREDICATES:
        is_valid = kinds == [FLOAT]
    elif value.operator in ("&&", "||", "!"):
        is_valid = set(kinds) == {BOOL}
    else:
        is_valid = _are_comparable(value.operands, kinds, mine)
    if not is_valid:
        raise UnclearError
    return BOOL


def _are_comparable(operands: tuple[Expression, ...], kinds: list[str], mine: Mapping[str, Field]) -> bool:
    """Whether C++ compares two values as Python does: it converts negative integers to unsigned types."""
    if set(kinds) == {INTEGER, FLOAT}:
        return all(kind == FLOAT or isinstance(each, Number) for each, kind in zip(operands, kinds, strict=True))
    if set(kinds) != {INTEGER}:
        return len(set(kinds)) == 1
    ranges = [_range(operand, mine) for operand in operands]
    is_large = any(low == 0 and high >= _PROMOTED_BELOW for low, high in ranges)
    return not (is_large and any(low < 0 for low, _ in ranges))


def _range(value: Expression, mine: Mapping[str, Field]) -> tuple[int, int]:
    """Return the smallest and the largest value of an integer expression."""
    if isinstance(value, Number):
        number = int(value.value or 0)
        return min(number, 0), number
    if isinstance(value, Place):
        return PRIMITIVES[mine[value.field].type.name].integer_range
    ranges = [_range(operand, mine) for operand in value.operands[1:]]
    return min(low for low, _ in ranges), max(high for _, high in ranges)
