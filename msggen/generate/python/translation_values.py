"""The values of a translation: their kinds, and their conversion to the types of fields."""

from __future__ import annotations

from collections.abc import Mapping
from struct import pack, unpack

from msggen.definitions.model import Field, FieldType
from msggen.definitions.primitives import FLOATS, INTEGERS, PRIMITIVES
from msggen.definitions.translation import CHOICE, PREDICATES, Expression, Number, Operation, Place

BOOL, INTEGER, FLOAT = "bool", "integer", "float"
KINDS = {"bool": BOOL, **dict.fromkeys(INTEGERS, INTEGER), **dict.fromkeys(FLOATS, FLOAT)}
"""The kind of each primitive type."""

_PROMOTED_BELOW = 2**31
"""C++ promotes an integer to `int` before a comparison if all values of its type are below this number."""


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
