"""A reader that turns the statements of a translation into rules for the fields of two definitions.

A field that the header copies from the field of the same name needs no rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, pairwise
from typing import NamedTuple

from msggen.definitions.model import ArrayKind, Catalog, Field, Message
from msggen.definitions.translation import (
    CHOICE,
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
from msggen.generate.python.names import attribute_names
from msggen.generate.python.translation_rules import (
    BOOL,
    EACH,
    FLOAT,
    INTEGER,
    KINDS,
    Computed,
    Copied,
    Part,
    Rule,
    UnclearError,
    Unread,
    element_slice,
    fitted,
    kind_of_value,
    places_of,
)

_ZEROS: Mapping[str, bool | float] = {BOOL: False, INTEGER: 0, FLOAT: 0.0}
_MAX_SIZE = 500
"""The largest number of operators and operands in the value of a field."""


def rules_of(
    catalog: Catalog, statements: Iterable[Statement], source: Message, target: Message, called: str
) -> tuple[Rule, ...]:
    """Return the rules that make `target` from `source`, in the order of the fields of `target`.

    `called` is the name of the source in the code of the rules.
    """
    found: _State = {}
    _Reader(catalog, source, target).run(statements, found, {})
    mine = {field.name: field for field in source.fields}
    rules = (_rule(field, found[field.name], mine, called) for field in target.fields if field.name in found)
    attributes = attribute_names(source)
    return tuple(_readable(rule, attributes) for rule in rules if rule is not None)


def _readable(rule: Rule, attributes: Mapping[str, str]) -> Rule:
    """Return `rule`, or Unread if its code reads fields that have another name in Python."""
    if isinstance(rule, Computed) and any(attributes[name] != name for name in rule.reads):
        return Unread(rule.field)
    return rule


def lost_elements(rules: Iterable[Rule], source: Message, target: Message) -> tuple[str, ...]:
    """Return the elements of `source` that no rule reads, in fields of which other elements are read."""
    read: dict[str, set[int]] = {}
    computed = [rule for rule in rules if isinstance(rule, Computed)]
    for part in chain.from_iterable(rule.parts for rule in computed):
        for place in places_of(part.value):
            element = place.path[0].element
            if element is not None:
                elements = [element] if isinstance(element, int) else range(part.start, part.stop)
                read.setdefault(place.field, set()).update(elements)
    whole = _read_as_wholes(rules, target)
    return tuple(
        element_slice(field.name, start, stop)
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
    """The unchanged value of a field of the source."""

    source: str


_Value = _Whole | tuple[Part, ...] | None
"""The value that a field is set to; None if it is unclear."""

_State = dict[str, _Value]
_Loops = Mapping[str, tuple[int, int | None]]
"""The start and the end of each loop by variable; the end is None if it is the size of a sequence."""


def _rule(field: Field, value: _Value, mine: Mapping[str, Field], called: str) -> Rule | None:
    """Return the rule for a field, or None if the field of the same name is copied unchanged."""
    if isinstance(value, tuple) and not isinstance(value, _Whole):
        value = _as_whole(field, _joined(value), mine)
    if isinstance(value, _Whole):
        if value.source == field.name:
            return None
        return Copied(field.name, value.source) if _are_alike(field, mine[value.source]) else Unread(field.name)
    if not value:
        return Unread(field.name)
    zero = _ZEROS[KINDS[field.type.name]]
    rest = field.default if isinstance(field.default, tuple) else (zero,) * field.type.length
    return Computed(field.name, field.type, value, rest, called)


def _joined(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Return `parts` sorted, with adjacent parts of the same value merged."""
    found: list[Part] = []
    for part in sorted(parts, key=lambda part: part.start):
        if found and found[-1].stop == part.start and found[-1].value == part.value:
            found[-1] = found[-1]._replace(stop=part.stop)
        else:
            found.append(part)
    return tuple(found)


def _as_whole(field: Field, parts: tuple[Part, ...], mine: Mapping[str, Field]) -> _Value:
    """Return the field of the source if `parts` are all of its value, else the parts."""
    value = parts[0].value if len(parts) == 1 else None
    if not isinstance(value, Place):
        return parts
    (name, element), type_ = value.path[0], mine[value.field].type
    if field.type.array is ArrayKind.SCALAR:
        return _Whole(name) if element is None else parts
    every = (0, field.type.length) == parts[0][:2] and type_.length == field.type.length
    return _Whole(name) if every and element == EACH else parts


def _are_alike(one: Field, other: Field) -> bool:
    """Whether values of one field can be values of the other. The generated package checks each value."""
    is_single = [field.type.array is ArrayKind.SCALAR for field in (one, other)]
    kinds = [KINDS.get(field.type.name, "") if field.type.is_primitive else None for field in (one, other)]
    return is_single[0] == is_single[1] and kinds[0] == kinds[1]


class _Reader:
    """A reader of the statements of a translation, which records the value of each field of the target."""

    def __init__(self, catalog: Catalog, source: Message, target: Message) -> None:
        self.catalog = catalog
        self.source, self.target = source, target
        self.mine = {field.name: field for field in source.fields}
        self.theirs = {field.name: field for field in target.fields}

    def run(self, statements: Iterable[Statement], state: _State, loops: _Loops) -> None:
        """Update `state` with the values that `statements` set."""
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
            except UnclearError:
                state[name] = None

    def _repeat(self, loop: Loop, state: _State, loops: _Loops) -> None:
        try:
            stop = self._stop(loop.stops)
        except UnclearError:
            state.update(dict.fromkeys(fields_of(loop.body)))
            return
        if stop is None or loop.start < stop:
            self.run(loop.body, state, {**loops, loop.variable: (loop.start, stop)})

    def _choose(self, branch: Branch, state: _State, loops: _Loops) -> None:
        try:
            condition = self._condition(branch.condition)
        except UnclearError:
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
        if kind_of_value(found, self.mine) != BOOL:
            raise UnclearError
        return found

    def _stop(self, stops: tuple[Expression | Size, ...]) -> int | None:
        """Return the end of a loop, or None if it is the size of a sequence."""
        found = [self._size(stop) if isinstance(stop, Size) else self._constant(stop) for stop in stops]
        numbers = [number for number in found if number is not None]
        if 0 < len(numbers) < len(found):
            raise UnclearError
        return min(numbers) if numbers else None

    def _size(self, size: Size) -> int | None:
        type_ = self._field(size.of).type
        if type_.array is ArrayKind.SCALAR or len(size.of.path) > 1:
            raise UnclearError
        return type_.length if type_.array is ArrayKind.FIXED else None

    def _constant(self, expression: Expression) -> int:
        number = self._resolved(expression, None)
        if not isinstance(number, Number) or not isinstance(number.value, int):
            raise UnclearError
        return number.value

    def _field(self, place: Place) -> Field:
        field = (self.theirs if place.is_target else self.mine).get(place.field)
        if field is None:
            raise UnclearError
        return field

    def _assigned(self, statement: Assignment, before: _Value, loops: _Loops) -> _Value:
        """Return the value of a field after a statement; `before` is its value before. Raises UnclearError."""
        target, value = statement
        if value is None or before is None:
            raise UnclearError
        if len(target.path) > 1:
            return self._inside(target, value, before)
        field, element = self._field(target), target.path[0].element
        if loops and element != [*loops][-1]:
            raise UnclearError
        if element is None:
            return self._whole(field, value)
        start, stop = (element, element + 1) if isinstance(element, int) else loops[element]
        if field.type.array is ArrayKind.FIXED and field.type.name in KINDS and stop is not None:
            if not 0 <= start < stop <= field.type.length:
                raise UnclearError
            part = Part(start, stop, self._element(field, element, start, stop, value))
            return _overlaid(self._parts(before), part)
        if isinstance(value, Place) and value.path == (Step(value.field, element),) and isinstance(element, str):
            return self._every(field, value, start, stop)
        raise UnclearError

    def _inside(self, target: Place, value: Expression, before: _Value) -> _Value:
        """Return the value of a field after a statement that sets a field inside it.

        Nested messages are copied by name, so the statement must do the same. Raises UnclearError.
        """
        is_same = isinstance(value, Place) and not value.is_target and value.path == target.path
        if target.field not in self.mine or before not in ((), _Whole(target.field)):
            raise UnclearError
        if not is_same and self._has(self.source, target.path):
            raise UnclearError
        return _Whole(target.field)

    def _has(self, message: Message, path: tuple[Step, ...]) -> bool:
        """Whether `message` has a field at `path`."""
        field = next((field for field in message.fields if field.name == path[0].name), None)
        if field is None or len(path) == 1:
            return field is not None
        return field.type.is_primitive or self._has(self.catalog.nested(message, field.type), path[1:])

    def _every(self, field: Field, value: Place, start: int, stop: int | None) -> _Value:
        """Return the value of a sequence or an array of messages that a loop copies. Raises UnclearError."""
        other = self._field(value)
        sizes = {self._size(Size(Place(is_target=False, path=(Step(other.name),)))), stop}
        if value.is_target or start or len(sizes) > 1 or field.type.array is ArrayKind.SCALAR:
            raise UnclearError
        return _Whole(other.name)

    def _whole(self, field: Field, value: Expression) -> _Value:
        type_ = field.type
        has_parts = type_.name in KINDS and type_.is_primitive
        if value == Number(None) and has_parts and type_.array in (ArrayKind.SCALAR, ArrayKind.FIXED):
            return (Part(0, type_.element_count, fitted(Number(0), type_, self.mine)),)
        if has_parts and type_.array is ArrayKind.SCALAR:
            return (Part(0, 1, fitted(self._resolved(value, None), type_, self.mine)),)
        if not isinstance(value, Place) or value.is_target or value.path[0].element is not None or len(value.path) > 1:
            raise UnclearError
        return _Whole(self._field(value).name)

    def _parts(self, value: _Value) -> tuple[Part, ...]:
        """Return the value of an array as parts."""
        if not isinstance(value, _Whole):
            return value or ()
        return (Part(0, self.mine[value.source].type.length, _place(value.source, EACH)),)

    def _element(self, field: Field, element: int | str, start: int, stop: int, value: Expression) -> Expression:
        resolved = self._resolved(value, element if isinstance(element, str) else None, start, stop)
        if isinstance(resolved, Place) and resolved.path[0].element == start == element:
            resolved = _place(resolved.field, EACH)
        return fitted(resolved, field.type, self.mine)

    def _resolved(self, value: Expression, variable: str | None, start: int = 0, stop: int = 0) -> Expression:
        """Return `value` with constants as numbers and with `EACH` as the index of a loop.

        All other places are fields of the source. Raises UnclearError.
        """
        if isinstance(value, Number):
            if value.value is None:
                raise UnclearError
            return value
        if isinstance(value, Operation):
            operands = [self._resolved(operand, variable, start, stop) for operand in value.operands]
            return Operation(value.operator, tuple(operands))
        name, element = value.path[0]
        if len(value.path) > 1 or (value.is_target and name in self.theirs):
            raise UnclearError
        if name not in self.mine or value.is_target:
            return self._named(value)
        type_ = self.mine[name].type
        is_each = element == variable and isinstance(element, str)
        last = stop - 1 if is_each else element
        if type_.name not in KINDS or (isinstance(element, str) and not is_each):
            raise UnclearError
        if type_.array is ArrayKind.SCALAR and last is None:
            return value
        if type_.array is not ArrayKind.FIXED or not isinstance(last, int) or not 0 <= last < type_.length or start < 0:
            raise UnclearError
        return _place(name, EACH if is_each else last)

    def _named(self, place: Place) -> Number:
        """Return the value of the constant that `place` names. Raises UnclearError."""
        message = self.target if place.is_target else self.source
        for constant in message.constants:
            if constant.name == place.field and isinstance(constant.value, (int, float)):
                return Number(constant.value, constant.name)
        raise UnclearError


def _place(name: str, element: int | str | None) -> Place:
    return Place(is_target=False, path=(Step(name, element),))


def _overlaid(parts: tuple[Part, ...], new: Part) -> tuple[Part, ...]:
    """Return `parts` with `new`, which replaces the elements in its range."""
    kept = []
    for part in parts:
        before = part._replace(stop=min(part.stop, new.start))
        after = part._replace(start=max(part.start, new.stop))
        kept += [piece for piece in (before, after) if piece.start < piece.stop]
    return (*kept, new)


def _chosen(condition: Expression, one: _Value, other: _Value) -> _Value:
    """Return the choice between two values, or None if they do not have the same elements."""
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
    """Return `value`, or None if it is too large, because each nested condition doubles its size."""
    if value is None or isinstance(value, _Whole):
        return value
    return value if len(value) <= _MAX_SIZE and sum(_size(part.value) for part in value) <= _MAX_SIZE else None


def _size(value: Expression) -> int:
    return 1 + sum(map(_size, value.operands)) if isinstance(value, Operation) else 1


def _cut(parts: Iterable[Part], limits: list[int]) -> list[Part]:
    """Return `parts` sorted, and cut at each of `limits`."""
    return [
        Part(start, stop, part.value)
        for part in sorted(parts, key=lambda part: part.start)
        for start, stop in pairwise([limit for limit in limits if part.start <= limit <= part.stop])
    ]


def _runs(indices: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield the start and the end of each run of consecutive numbers."""
    start = stop = -1
    for index in indices:
        if index != stop:
            if stop > start:
                yield start, stop
            start = index
        stop = index + 1
    if stop > start:
        yield start, stop
