"""Two catalogs side by side: which messages and fields belong together, and whether their bytes are the same.

Whatever several rules ask is answered here, once. Comments and white space have no part in it.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from msggen.compare.finding import Reader
from msggen.compare.renaming import Candidates, is_renamed, nearest_message
from msggen.firmware.history import History
from msggen.layout import Layout, Path, is_static, lay_out
from msggen.location import Location
from msggen.model import VERSION, Catalog, Constant, Field, FieldType, Message, Value
from msggen.primitives import OCTETS

Shape = tuple["tuple[str, str, Shape | None]", ...]
"""Type and name of each field, and the shape of what it nests: all that decides bytes, names and hashes."""


class Extra(NamedTuple):
    """A definition of which only the name is known: `kind` is "message" or "service"."""

    kind: str
    name: str
    location: Location


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two: what it is called, where it is, its definitions, what it keeps of earlier versions.

    `extra` are definitions that were not read, because the other side has none of that name. Without a bridge it
    says nothing on topics.
    """

    label: str
    place: str
    catalog: Catalog
    has_bridge: bool = False
    history: History | None = None
    extra: tuple[Extra, ...] = ()


@dataclass(frozen=True, slots=True)
class FieldPair:
    """A field of the previous side, and the one that it is in the current side."""

    previous: Field
    current: Field


class MessagePair:
    """A message that both sides have, or half of a service."""

    def __init__(
        self, previous_catalog: Catalog, previous: Message, current_catalog: Catalog, current: Message
    ) -> None:
        self._previous_catalog = previous_catalog
        self._current_catalog = current_catalog
        self.previous = previous
        self.current = current

    @property
    def name(self) -> str:
        """What both are called."""
        return self.current.name

    @cached_property
    def differs(self) -> bool:
        """Whether any type or name in it is another, at any depth."""
        return shape(self._previous_catalog, self.previous) != shape(self._current_catalog, self.current)

    @cached_property
    def has_same_comments(self) -> bool:
        """Whether both have the same fields with the same comments, as most messages have."""
        before, after = ([(each.name, each.comment) for each in side.fields] for side in (self.previous, self.current))
        return before == after

    @cached_property
    def kept(self) -> tuple[FieldPair, ...]:
        """Fields with the same name, in the current order."""
        by_name = {field.name: field for field in self.previous.fields}
        return tuple(FieldPair(by_name[field.name], field) for field in self.current.fields if field.name in by_name)

    @cached_property
    def renamed(self) -> tuple[FieldPair, ...]:
        """Fields of the same type in the same bytes whose names or comments say that they are the same field."""
        fields = Candidates(self._lost, self._gained, [pair.current for pair in self.kept])
        return tuple(pair for pair in self._in_place if is_renamed(pair.previous, pair.current, fields))

    @cached_property
    def replaced(self) -> tuple[FieldPair, ...]:
        """Fields of the same type in the same bytes that nothing else says to be the same field."""
        return tuple(pair for pair in self._in_place if pair not in self.renamed)

    @cached_property
    def removed(self) -> tuple[Field, ...]:
        """Fields that the current side does not have."""
        renamed = [pair.previous for pair in self.renamed]
        return tuple(field for field in self._lost if field not in renamed)

    @cached_property
    def added(self) -> tuple[Field, ...]:
        """Fields that the previous side does not have."""
        renamed = [pair.current for pair in self.renamed]
        return tuple(field for field in self._gained if field not in renamed)

    @cached_property
    def moved(self) -> tuple[FieldPair, ...]:
        """The fewest fields that have to change places for the others to stand in the same order."""
        order = [self.previous.fields.index(pair.previous) for pair in self.kept]
        stay = _longest_increasing(order)
        return tuple(pair for index, pair in enumerate(self.kept) if index not in stay)

    @cached_property
    def previous_layout(self) -> Layout | None:
        """Where the bytes lie in the previous side; None where the size is not fixed."""
        return _layout(self._previous_catalog, self.previous)

    @cached_property
    def current_layout(self) -> Layout | None:
        """Where the bytes lie in the current side; None where the size is not fixed."""
        return _layout(self._current_catalog, self.current)

    @cached_property
    def misread_by(self) -> tuple[Reader, ...]:
        """Which readers decode the other side's samples into wrong values without an error.

        Samples arrive rounded up to 4 bytes, so sizes count rounded up. Values are right where a field of
        the same name and meaning, or one that was only renamed, lies in the same bytes of the other side. What lies in
        its padding is wrong: padding is not zero on the wire.
        """
        if not (self.previous_layout and self.current_layout):
            return ()
        if -(-self.previous_layout.size // 4) != -(-self.current_layout.size // 4):
            return ()
        before = {(self._current_path(path), *value) for path, *value in _values(self.previous_layout)}
        after = set(_values(self.current_layout))
        misread = {Reader.OLD: before - after, Reader.NEW: after - before}
        return tuple(reader for reader, values in misread.items() if values)

    @cached_property
    def nested(self) -> Mapping[str, MessagePair]:
        """The messages that kept and renamed fields nest on both sides, by the field's previous name."""
        return {
            pair.previous.name: MessagePair(
                self._previous_catalog,
                self._previous_catalog.nested(self.previous, pair.previous.type),
                self._current_catalog,
                self._current_catalog.nested(self.current, pair.current.type),
            )
            for pair in (*self.kept, *self.renamed)
            if not (pair.previous.type.is_primitive or pair.current.type.is_primitive)
        }

    @cached_property
    def is_only_renamed(self) -> bool:
        """Whether every value lies where it did, down to every depth, whatever it is called now."""
        if self.added or self.removed or self.moved:
            return False
        pairs = (*self.kept, *self.renamed)
        return all(map(has_same_length, pairs)) and all(
            self.nested[pair.previous.name].is_only_renamed
            if pair.previous.name in self.nested
            else meaning(pair.previous.type) == meaning(pair.current.type)
            for pair in pairs
        )

    @cached_property
    def _lost(self) -> tuple[Field, ...]:
        names = {field.name for field in self.current.fields}
        return tuple(field for field in self.previous.fields if field.name not in names)

    @cached_property
    def _gained(self) -> tuple[Field, ...]:
        names = {field.name for field in self.previous.fields}
        return tuple(field for field in self.current.fields if field.name not in names)

    @cached_property
    def _in_place(self) -> tuple[FieldPair, ...]:
        """Fields with another name that lie in the same bytes with the same type."""
        lost = {self._place(self.previous_layout, self.previous, field): field for field in self._lost}
        pairs = ((lost.get(self._place(self.current_layout, self.current, field)), field) for field in self._gained)
        return tuple(FieldPair(previous, field) for previous, field in pairs if previous)

    def _current_path(self, path: Path) -> Path:
        """Return how to reach in the current side what `path` reaches in the previous one, renamed fields followed."""
        (name, index), inside = path[0], path[1:]
        if inside and name in self.nested:
            inside = self.nested[name]._current_path(inside)  # noqa: SLF001 - another of this class
        now = {pair.previous.name: pair.current.name for pair in self.renamed}
        return ((now.get(name, name), index), *inside)

    def _place(self, layout: Layout | None, message: Message, field: Field) -> tuple[str, object]:
        """Return the type of a field and where it lies; where offsets are not fixed, the types before it say that."""
        if layout:
            return str(field.type), layout.extents()[field.name]
        before = message.fields[: message.fields.index(field)]
        return str(field.type), tuple(str(earlier.type) for earlier in before)


class Comparison:
    """Both sides, and what belongs together in them."""

    def __init__(self, previous: Side, current: Side) -> None:
        self.previous = previous
        self.current = current

    @cached_property
    def pairs(self) -> tuple[MessagePair, ...]:
        """Messages and halves of services that both sides have, by name."""
        previous, current = self.previous.catalog, self.current.catalog
        before, after = definitions(previous), definitions(current)
        names = sorted(before.keys() & after)
        return tuple(MessagePair(previous, before[name], current, after[name]) for name in names)

    @cached_property
    def renamed_messages(self) -> Mapping[str, str]:
        """The messages that the current side has under another name, by their previous name: nothing else differs."""
        before, after = (
            {each.name: each for each in side.catalog.uorb_messages} for side in (self.previous, self.current)
        )
        gained = {name: _content(self.current.catalog, after[name]) for name in after.keys() - before}
        found: dict[str, str] = {}
        for name in sorted(before.keys() - after):
            content = _content(self.previous.catalog, before[name])
            now = nearest_message(name, sorted(other for other in gained if gained[other] == content))
            if now:
                found[name] = now
                del gained[now]
        return found

    @cached_property
    def changed(self) -> tuple[MessagePair, ...]:
        """The pairs in which any type or name is another, at any depth."""
        return tuple(pair for pair in self.pairs if pair.differs)


def shape(catalog: Catalog, message: Message) -> Shape:
    """Return types and names of a message, down to every depth."""
    return tuple(
        (
            spelled(message, field.type),
            field.name,
            None if field.type.is_primitive else shape(catalog, catalog.nested(message, field.type)),
        )
        for field in message.fields
    )


def _content(catalog: Catalog, message: Message) -> tuple[Shape, dict[str, tuple[str, Value]]]:
    """Return all of a definition but its name, its comments and its version."""
    constants = {each.name: (str(each.type), each.value) for each in message.constants if each.name != VERSION}
    return shape(catalog, message), constants


def meaning(type_: FieldType) -> str:
    """Return what one value of a type means: `char` and `byte` are other names for `uint8`."""
    return "uint8" if type_.base in OCTETS else type_.base


def has_same_length(pair: FieldPair) -> bool:
    """Whether both fields hold as many values."""
    before, after = pair.previous.type, pair.current.type
    return (before.array, before.length) == (after.array, after.length)


def spelled(outer: Message, type_: FieldType) -> str:
    """Return the type as the definition spells it; the package of `outer` itself need not be named."""
    text = str(type_)
    return text.removeprefix(f"{outer.package}/") if type_.package else text


def constants_of(message: Message) -> dict[str, Constant]:
    """Return the constants by name."""
    return {constant.name: constant for constant in message.constants}


def definitions(catalog: Catalog) -> dict[str, Message]:
    """Return all messages and halves of services by name, without those of further packages, which are only nested."""
    halves = [half for service in catalog.own_services for half in (service.request, service.response)]
    return {message.name: message for message in (*catalog.uorb_messages, *halves)}


def _layout(catalog: Catalog, message: Message) -> Layout | None:
    return lay_out(catalog, message) if is_static(catalog, message) else None


def _values(layout: Layout) -> Iterator[tuple[Path, int, int, str]]:
    """Yield for each value how to reach it, its place in its array, its offset, and what its bytes mean.

    A single message is reached like the first of an array: the bytes are the same.
    """
    for leaf in layout.leaves:
        path = tuple((name, index or 0) for name, index in leaf.path)
        for index in range(leaf.element_count):
            yield path, index, leaf.offset + index * leaf.size, meaning(leaf.type)


def _longest_increasing(numbers: list[int]) -> set[int]:
    """Return the positions of a longest increasing selection of `numbers`, which are all different."""
    ends: list[int] = []  # positions: the smallest number that ends a selection of each length
    before: list[int | None] = []
    for position, number in enumerate(numbers):
        length = bisect_left([numbers[end] for end in ends], number)
        before.append(ends[length - 1] if length else None)
        ends[length : length + 1] = [position]
    chosen: set[int] = set()
    last = ends[-1] if ends else None
    while last is not None:
        chosen.add(last)
        last = before[last]
    return chosen
