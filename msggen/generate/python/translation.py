"""The statements of a translation as rules for the fields of two definitions.

A rule stands for what names alone do not tell. A field that the header sets from the one of the same name needs none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import chain, pairwise
from struct import pack, unpack
from typing import NamedTuple

from msggen.generate.python.formatting import joined_by, literal, wrapped
from msggen.generate.python.names import attribute_names
from msggen.model import ArrayKind, Catalog, Field, FieldType, Message, Value
from msggen.primitives import FLOATS, INTEGERS, PRIMITIVES
from msggen.translation import (
    CHOICE,
    ISFINITE,
    ISINF,
    ISNAN,
    Assignment,
    Branch,
    Expression,
    Loop,
    Number,
    Operation,
    Place,
    Size,
    Statement,
    Step,
)

_EACH = "i"
"""The index of an element in the value of a part."""

_BOOL, _INTEGER, _FLOAT = "bool", "integer", "float"
_KINDS = {"bool": _BOOL, **dict.fromkeys(INTEGERS, _INTEGER), **dict.fromkeys(FLOATS, _FLOAT)}
_ZEROS: Mapping[str, bool | float] = {_BOOL: False, _INTEGER: 0, _FLOAT: 0.0}
_PREDICATES = (ISNAN, ISFINITE, ISINF)
_PYTHON = {"&&": "and", "||": "or"}
_BINDING = {CHOICE: 0, "||": 1, "&&": 2, "!": 3, **dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), 4)}
_LONG = 80
"""Expressions of that length are written on lines of their own."""

_MAX_SIZE = 500
"""Operators and operands in the value of a field."""

_PROMOTED_BELOW = 2**31
"""Types whose values are all smaller are compared as `int` in C++, others as they are."""


class _UnclearError(ValueError):
    """The value does not fit, or cannot be told from the definitions."""


class Copied(NamedTuple):
    """The value of a field of another name."""

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
    """Elements from `start` to `stop`, and their value."""

    start: int
    stop: int
    value: Expression


class Computed(NamedTuple):
    """A value that is computed; of an array, that of its parts. `rest` is what other elements are left at."""

    field: str
    type: FieldType
    parts: tuple[Part, ...]
    rest: tuple[Value, ...]
    source: str
    """What the other message is called: "older" or "newer"."""

    @property
    def reads(self) -> tuple[str, ...]:
        """The fields that the value is made of."""
        return tuple(dict.fromkeys(place.field for part in self.parts for place in _places(part.value)))

    @property
    def unset(self) -> tuple[str, ...]:
        """The elements that get no value."""
        return tuple(
            _slice(self.field, start, stop) for start, stop, value in self._every() if not isinstance(value, Expression)
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
        return ", ".join(self._said(part) for part in self.parts)

    def _said(self, part: Part) -> str:
        name = self.field if self.type.array is ArrayKind.SCALAR else _slice(self.field, part.start, part.stop)
        value = part.value
        if isinstance(value, Place) and value.path[0].element == _EACH:
            return f"`{name}` from `{_slice(value.field, part.start, part.stop)}`"
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
        """Yield all elements: those that get a value with that, the others with what they are left at."""
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
        if isinstance(value, Place) and value.path[0].element == _EACH:
            return f"{self.source}.{value.field}[{start}:{stop}]"
        text = _python(value, f"{self.source}.")
        if any(place.path[0].element == _EACH for place in _places(value)):
            return f"[{text} for {_EACH} in range({start}, {stop})]"
        return f"({text},)" + (f" * {stop - start}" if stop - start > 1 else "")


class Unread(NamedTuple):
    """No value: the header does not say it plainly, or says what the field cannot hold."""

    field: str

    @property
    def code(self) -> str:
        """The rule in the generated table."""
        return f"Unread({literal(self.field)})"

    @property
    def documentation(self) -> str:
        """The rule in the docstring of the method."""
        return f"`{self.field}` is left at its default: the statement could not be read"


Rule = Copied | Computed | Unread


def rules_of(
    catalog: Catalog, statements: Iterable[Statement], source: Message, target: Message, called: str
) -> tuple[Rule, ...]:
    """Return the rules by which `target` is made of `source`, in the order of its fields.

    `called` is what the source is called in the code of the rules.
    """
    found: _State = {}
    _Reader(catalog, source, target).run(statements, found, {})
    mine = {field.name: field for field in source.fields}
    rules = (_rule(field, found[field.name], mine, called) for field in target.fields if field.name in found)
    attributes = attribute_names(source)
    return tuple(_readable(rule, attributes) for rule in rules if rule is not None)


def _readable(rule: Rule, attributes: Mapping[str, str]) -> Rule:
    """Return `rule`; one whose code would name fields that are called otherwise in Python counts as not read."""
    if isinstance(rule, Computed) and any(attributes[name] != name for name in rule.reads):
        return Unread(rule.field)
    return rule


def lost_elements(rules: Iterable[Rule], source: Message, target: Message) -> tuple[str, ...]:
    """Return the elements of fields of `source` that no rule reads, where others of the same field are read."""
    read: dict[str, set[int]] = {}
    computed = [rule for rule in rules if isinstance(rule, Computed)]
    for part in chain.from_iterable(rule.parts for rule in computed):
        for place in _places(part.value):
            element = place.path[0].element
            if element is not None:
                elements = [element] if isinstance(element, int) else range(part.start, part.stop)
                read.setdefault(place.field, set()).update(elements)
    whole = _read_as_wholes(rules, target)
    return tuple(
        _slice(field.name, start, stop)
        for field in source.fields
        if field.name in read and field.name not in whole
        for start, stop in _runs(index for index in range(field.type.length) if index not in read[field.name])
    )


def fields_of(statements: Iterable[Statement]) -> Iterator[str]:
    """Yield the fields that `statements` may set."""
    for statement in statements:
        if isinstance(statement, Assignment):
            yield statement.target.field
        elif isinstance(statement, Loop):
            yield from fields_of(statement.body)
        else:
            yield from fields_of((*statement.then, *statement.otherwise))


def _read_as_wholes(rules: Iterable[Rule], target: Message) -> set[str]:
    ruled = {rule.field for rule in rules}
    by_name = {field.name for field in target.fields if field.name not in ruled}
    return by_name | {rule.source for rule in rules if isinstance(rule, Copied)}


class _Whole(NamedTuple):
    """The value of a field of the source, as it is."""

    source: str


_Value = _Whole | tuple[Part, ...] | None
"""What a field is set to; None where that is not clear."""

_State = dict[str, _Value]
_Loops = Mapping[str, tuple[int, int | None]]
"""Start and end by variable; the end is None where it is that of a sequence."""


def _rule(field: Field, value: _Value, mine: Mapping[str, Field], called: str) -> Rule | None:
    """Return the rule for a field, None where the one of the same name is carried over as it is."""
    if isinstance(value, tuple) and not isinstance(value, _Whole):
        value = _as_whole(field, _joined(value), mine)
    if isinstance(value, _Whole):
        if value.source == field.name:
            return None
        return Copied(field.name, value.source) if _are_alike(field, mine[value.source]) else Unread(field.name)
    if not value:
        return Unread(field.name)
    zero = _ZEROS[_KINDS[field.type.name]]
    rest = field.default if isinstance(field.default, tuple) else (zero,) * field.type.length
    return Computed(field.name, field.type, value, rest, called)


def _joined(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Return `parts` in their order, those that adjoin each other as one."""
    found: list[Part] = []
    for part in sorted(parts, key=lambda part: part.start):
        if found and found[-1].stop == part.start and found[-1].value == part.value:
            found[-1] = found[-1]._replace(stop=part.stop)
        else:
            found.append(part)
    return tuple(found)


def _as_whole(field: Field, parts: tuple[Part, ...], mine: Mapping[str, Field]) -> _Value:
    """Return the field that all of `parts` are the value of, or the parts themselves."""
    value = parts[0].value if len(parts) == 1 else None
    if not isinstance(value, Place):
        return parts
    (name, element), type_ = value.path[0], mine[value.field].type
    if field.type.array is ArrayKind.SCALAR:
        return _Whole(name) if element is None else parts
    every = (0, field.type.length) == parts[0][:2] and type_.length == field.type.length
    return _Whole(name) if every and element == _EACH else parts


def _are_alike(one: Field, other: Field) -> bool:
    """Whether values of one field can be values of the other; the generated package looks at each of them."""
    is_single = [field.type.array is ArrayKind.SCALAR for field in (one, other)]
    kinds = [_KINDS.get(field.type.name, "") if field.type.is_primitive else None for field in (one, other)]
    return is_single[0] == is_single[1] and kinds[0] == kinds[1]


class _Reader:
    """Goes through the statements of a translation, and keeps what each field of the target is set to."""

    def __init__(self, catalog: Catalog, source: Message, target: Message) -> None:
        self.catalog = catalog
        self.source, self.target = source, target
        self.mine = {field.name: field for field in source.fields}
        self.theirs = {field.name: field for field in target.fields}

    def run(self, statements: Iterable[Statement], state: _State, loops: _Loops) -> None:
        """Set in `state` what `statements` set."""
        for statement in statements:
            if isinstance(statement, Assignment):
                self._assign(statement, state, loops)
            elif isinstance(statement, Loop):
                self._repeat(statement, state, loops)
            else:
                self._choose(statement, state, loops)

    def _assign(self, statement: Assignment, state: _State, loops: _Loops) -> None:
        name = statement.target.field
        if name in self.theirs:
            try:
                state[name] = _limited(self._assigned(statement, state.get(name, ()), loops))
            except _UnclearError:
                state[name] = None

    def _repeat(self, loop: Loop, state: _State, loops: _Loops) -> None:
        try:
            stop = self._stop(loop.stops)
        except _UnclearError:
            state.update(dict.fromkeys(fields_of(loop.body)))
            return
        if stop is None or loop.start < stop:
            self.run(loop.body, state, {**loops, loop.variable: (loop.start, stop)})

    def _choose(self, branch: Branch, state: _State, loops: _Loops) -> None:
        try:
            condition = self._condition(branch.condition)
        except _UnclearError:
            state.update(dict.fromkeys(fields_of((branch,))))
            return
        then, otherwise = dict(state), dict(state)
        self.run(branch.then, then, loops)
        self.run(branch.otherwise, otherwise, loops)
        for name in {**then, **otherwise}:
            one, other = then.get(name), otherwise.get(name)
            state[name] = one if one == other else _limited(_chosen(condition, one, other))

    def _condition(self, expression: Expression) -> Expression:
        found = self._resolved(expression, None)
        if _kind(found, self.mine) != _BOOL:
            raise _UnclearError
        return found

    def _stop(self, stops: tuple[Expression | Size, ...]) -> int | None:
        """Return where a loop ends, None where that is the size of a sequence."""
        found = [self._size(stop) if isinstance(stop, Size) else self._constant(stop) for stop in stops]
        numbers = [number for number in found if number is not None]
        if 0 < len(numbers) < len(found):
            raise _UnclearError
        return min(numbers) if numbers else None

    def _size(self, size: Size) -> int | None:
        type_ = self._field(size.of).type
        if type_.array is ArrayKind.SCALAR or len(size.of.path) > 1:
            raise _UnclearError
        return type_.length if type_.array is ArrayKind.FIXED else None

    def _constant(self, expression: Expression) -> int:
        number = self._resolved(expression, None)
        if not isinstance(number, Number) or not isinstance(number.value, int):
            raise _UnclearError
        return number.value

    def _field(self, place: Place) -> Field:
        field = (self.theirs if place.is_target else self.mine).get(place.field)
        if field is None:
            raise _UnclearError
        return field

    def _assigned(self, statement: Assignment, before: _Value, loops: _Loops) -> _Value:
        """Return what a field is set to that was set to `before`."""
        target, value = statement
        if value is None or before is None:
            raise _UnclearError
        if len(target.path) > 1:
            return self._inside(target, value, before)
        field, element = self._field(target), target.path[0].element
        if loops and element != [*loops][-1]:
            raise _UnclearError
        if element is None:
            return self._whole(field, value)
        start, stop = (element, element + 1) if isinstance(element, int) else loops[element]
        if field.type.array is ArrayKind.FIXED and field.type.name in _KINDS and stop is not None:
            if not 0 <= start < stop <= field.type.length:
                raise _UnclearError
            part = Part(start, stop, self._element(field, element, start, stop, value))
            return _overlaid(self._parts(before), part)
        if isinstance(value, Place) and value.path == (Step(value.field, element),) and isinstance(element, str):
            return self._every(field, value, start, stop)
        raise _UnclearError

    def _inside(self, target: Place, value: Expression, before: _Value) -> _Value:
        """Return what a field is set to when a field inside it is: what is inside is carried over by name."""
        is_same = isinstance(value, Place) and not value.is_target and value.path == target.path
        if target.field not in self.mine or before not in ((), _Whole(target.field)):
            raise _UnclearError
        if not is_same and self._has(self.source, target.path):
            raise _UnclearError
        return _Whole(target.field)

    def _has(self, message: Message, path: tuple[Step, ...]) -> bool:
        """Whether `message` has a field at `path`."""
        field = next((field for field in message.fields if field.name == path[0].name), None)
        if field is None or len(path) == 1:
            return field is not None
        return field.type.is_primitive or self._has(self.catalog.nested(message, field.type), path[1:])

    def _every(self, field: Field, value: Place, start: int, stop: int | None) -> _Value:
        """Return what a sequence or an array of messages is set to, element by element."""
        other = self._field(value)
        sizes = {self._size(Size(Place(is_target=False, path=(Step(other.name),)))), stop}
        if value.is_target or start or len(sizes) > 1 or field.type.array is ArrayKind.SCALAR:
            raise _UnclearError
        return _Whole(other.name)

    def _whole(self, field: Field, value: Expression) -> _Value:
        type_ = field.type
        has_parts = type_.name in _KINDS and type_.is_primitive
        if value == Number(None) and has_parts and type_.array in (ArrayKind.SCALAR, ArrayKind.FIXED):
            return (Part(0, type_.element_count, _fitted(Number(0), type_, self.mine)),)
        if has_parts and type_.array is ArrayKind.SCALAR:
            return (Part(0, 1, _fitted(self._resolved(value, None), type_, self.mine)),)
        if not isinstance(value, Place) or value.is_target or value.path[0].element is not None or len(value.path) > 1:
            raise _UnclearError
        return _Whole(self._field(value).name)

    def _parts(self, value: _Value) -> tuple[Part, ...]:
        """Return the elements of what an array is set to."""
        if not isinstance(value, _Whole):
            return value or ()
        return (Part(0, self.mine[value.source].type.length, _place(value.source, _EACH)),)

    def _element(self, field: Field, element: int | str, start: int, stop: int, value: Expression) -> Expression:
        resolved = self._resolved(value, element if isinstance(element, str) else None, start, stop)
        if isinstance(resolved, Place) and resolved.path[0].element == start == element:
            resolved = _place(resolved.field, _EACH)
        return _fitted(resolved, field.type, self.mine)

    def _resolved(self, value: Expression, variable: str | None, start: int = 0, stop: int = 0) -> Expression:
        """Return `value` in terms of the fields of the source; the elements of a loop are called `_EACH`."""
        if isinstance(value, Number):
            if value.value is None:
                raise _UnclearError
            return value
        if isinstance(value, Operation):
            operands = [self._resolved(operand, variable, start, stop) for operand in value.operands]
            return Operation(value.operator, tuple(operands))
        name, element = value.path[0]
        if len(value.path) > 1 or (value.is_target and name in self.theirs):
            raise _UnclearError
        if name not in self.mine or value.is_target:
            return self._named(value)
        type_ = self.mine[name].type
        is_each = element == variable and isinstance(element, str)
        last = stop - 1 if is_each else element
        if type_.name not in _KINDS or (isinstance(element, str) and not is_each):
            raise _UnclearError
        if type_.array is ArrayKind.SCALAR and last is None:
            return value
        if type_.array is not ArrayKind.FIXED or not isinstance(last, int) or not 0 <= last < type_.length or start < 0:
            raise _UnclearError
        return _place(name, _EACH if is_each else last)

    def _named(self, place: Place) -> Number:
        """Return the constant that `place` names."""
        message = self.target if place.is_target else self.source
        for constant in message.constants:
            if constant.name == place.field and isinstance(constant.value, (int, float)):
                return Number(constant.value, constant.name)
        raise _UnclearError


def _place(name: str, element: int | str | None) -> Place:
    return Place(is_target=False, path=(Step(name, element),))


def _overlaid(parts: tuple[Part, ...], new: Part) -> tuple[Part, ...]:
    """Return `parts` with another in place of the elements that they have in common."""
    kept = []
    for part in parts:
        before = part._replace(stop=min(part.stop, new.start))
        after = part._replace(start=max(part.start, new.stop))
        kept += [piece for piece in (before, after) if piece.start < piece.stop]
    return (*kept, new)


def _chosen(condition: Expression, one: _Value, other: _Value) -> _Value:
    """Return one value or the other; unclear unless both have the same elements."""
    if one is None or other is None or isinstance(one, _Whole) or isinstance(other, _Whole):
        return None
    limits = sorted({limit for part in (*one, *other) for limit in part[:2]})
    first, second = _cut(one, limits), _cut(other, limits)
    if [part[:2] for part in first] != [part[:2] for part in second]:
        return None
    return tuple(
        part if part == twin else part._replace(value=Operation(CHOICE, (condition, part.value, twin.value)))
        for part, twin in zip(first, second, strict=True)
    )


def _limited(value: _Value) -> _Value:
    """Return `value` unless it is too large: conditions in conditions double it each time."""
    if value is None or isinstance(value, _Whole):
        return value
    return value if len(value) <= _MAX_SIZE and sum(_size(part.value) for part in value) <= _MAX_SIZE else None


def _size(value: Expression) -> int:
    return 1 + sum(map(_size, value.operands)) if isinstance(value, Operation) else 1


def _cut(parts: Iterable[Part], limits: list[int]) -> list[Part]:
    """Return `parts` in their order, cut where one of `limits` is inside."""
    return [
        Part(start, stop, part.value)
        for part in sorted(parts, key=lambda part: part.start)
        for start, stop in pairwise([limit for limit in limits if part.start <= limit <= part.stop])
    ]


def _fitted(value: Expression, type_: FieldType, mine: Mapping[str, Field]) -> Expression:
    """Return `value` as one that a field of `type_` holds."""
    kind = _KINDS[type_.name]
    if isinstance(value, Number):
        return value._replace(value=_converted(value.value, type_))
    if isinstance(value, Operation) and value.operator == CHOICE:
        condition, one, other = value.operands
        if _kind(condition, mine) != _BOOL:
            raise _UnclearError
        return Operation(CHOICE, (condition, _fitted(one, type_, mine), _fitted(other, type_, mine)))
    if _kind(value, mine) != kind:
        raise _UnclearError
    return value


def _converted(value: float | None, type_: FieldType) -> bool | int | float:
    """Return a constant as a value of `type_`, as C++ converts it where nothing but digits of a float is lost."""
    if value is None:
        raise _UnclearError
    if type_.name == "bool":
        if value not in (0, 1):
            raise _UnclearError
        return bool(value)
    if type_.name in INTEGERS:
        low, high = PRIMITIVES[type_.name].integer_range
        if not low <= value <= high or value != int(value):
            raise _UnclearError
        return int(value)
    try:
        return float(unpack("<f", pack("<f", value))[0]) if type_.name == "float32" else float(value)
    except OverflowError:
        raise _UnclearError from None


def _kind(value: Expression, mine: Mapping[str, Field]) -> str:
    """Return what kind of value an expression has. Raises _UnclearError where C++ and Python may differ."""
    if isinstance(value, Number):
        return _BOOL if isinstance(value.value, bool) else _INTEGER if isinstance(value.value, int) else _FLOAT
    if isinstance(value, Place):
        return _KINDS[mine[value.field].type.name]
    kinds = [_kind(operand, mine) for operand in value.operands]
    if value.operator == CHOICE:
        if kinds[0] != _BOOL or kinds[1] != kinds[2]:
            raise _UnclearError
        return kinds[1]
    if value.operator in _PREDICATES:
        is_valid = kinds == [_FLOAT]
    elif value.operator in ("&&", "||", "!"):
        is_valid = set(kinds) == {_BOOL}
    else:
        is_valid = _are_comparable(value.operands, kinds, mine)
    if not is_valid:
        raise _UnclearError
    return _BOOL


def _are_comparable(operands: tuple[Expression, ...], kinds: list[str], mine: Mapping[str, Field]) -> bool:
    """Whether C++ compares two values by their numbers: it takes a negative integer for a large unsigned one."""
    if set(kinds) == {_INTEGER, _FLOAT}:
        return all(kind == _FLOAT or isinstance(each, Number) for each, kind in zip(operands, kinds, strict=True))
    if set(kinds) != {_INTEGER}:
        return len(set(kinds)) == 1
    ranges = [_range(operand, mine) for operand in operands]
    is_large = any(low == 0 and high >= _PROMOTED_BELOW for low, high in ranges)
    return not (is_large and any(low < 0 for low, _ in ranges))


def _range(value: Expression, mine: Mapping[str, Field]) -> tuple[int, int]:
    """Return the least and the largest value of an integer expression."""
    if isinstance(value, Number):
        number = int(value.value or 0)
        return min(number, 0), number
    if isinstance(value, Place):
        return PRIMITIVES[mine[value.field].type.name].integer_range
    ranges = [_range(operand, mine) for operand in value.operands[1:]]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _places(value: Expression) -> Iterator[Place]:
    """Yield the fields that a value is made of."""
    if isinstance(value, Place):
        yield value
    elif isinstance(value, Operation):
        for operand in value.operands:
            yield from _places(operand)


def _runs(indices: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield start and end of the runs in ascending numbers."""
    start = stop = -1
    for index in indices:
        if index != stop:
            if stop > start:
                yield start, stop
            start = index
        stop = index + 1
    if stop > start:
        yield start, stop


def _slice(name: str, start: int, stop: int) -> str:
    return f"{name}[{start}]" if stop - start == 1 else f"{name}[{start}:{stop}]"


def _python(value: Expression, prefix: str | None = None, least: int = 0) -> str:
    """Return `value` as Python, with `prefix` before the fields; without one as a reader is to see it."""
    if isinstance(value, Number):
        return _number(value, is_code=prefix is not None)
    if isinstance(value, Place):
        name, element = value.path[0]
        return f"{prefix or ''}{name}" + ("" if element is None else f"[{element}]")
    if value.operator in _PREDICATES:
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
    """Return the fewest digits that stand for a float32, or for a float64 that is none."""
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else str(value)
    for digits in range(1, 10):
        text = f"{value:.{digits}g}"
        with suppress(OverflowError):
            if unpack("<f", pack("<f", float(text)))[0] == value:
                return repr(float(text))
    return repr(value)
