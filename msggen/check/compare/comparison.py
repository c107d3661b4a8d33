"""Comparison of two catalogs: which messages and fields correspond, and whether their bytes are the same.

Facts that several rules need are computed here, once. White space is ignored. Comments are used only as evidence of
renamed fields, and by the rules about tags.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from msggen.base.location import Location
from msggen.check.compare.renaming import Candidates, is_renamed, nearest_message
from msggen.check.finding import Node
from msggen.definitions.identity import endpoints
from msggen.definitions.layout import Layout, Path, is_static, lay_out
from msggen.definitions.model import VERSION, Catalog, Constant, Field, FieldType, Message, Value
from msggen.definitions.primitives import OCTETS
from msggen.sources.history import History
from msggen.sources.inferred import Inference

Shape = tuple["tuple[str, str, Shape | None]", ...]
"""The type and the name of each field, and the shape of the message that it nests.

Messages with the same shape have the same bytes, names and hashes.
"""


class Extra(NamedTuple):
    """A definition that was not read, only found by its name; `kind` is "message" or "service"."""

    kind: str
    name: str
    location: Location


@dataclass(frozen=True, slots=True)
class Side:
    """One side of a comparison: its name in messages, its path, its definitions, and its archived versions.

    `extra` are definitions that were not read, because the other side has none with these names. Topics are only
    compared if both sides have a bridge. `inference` infers the tags of fields, and without it there are only those of
    the definitions.
    """

    label: str
    place: str
    catalog: Catalog
    has_bridge: bool = False
    history: History | None = None
    extra: tuple[Extra, ...] = ()
    inference: Inference | None = None

    def inferred(self, message: Message, field: Field) -> Field:
        """Return a field of `message` with the tags that can be inferred for it."""
        return self.inference.field(message, field) if self.inference else field


@dataclass(frozen=True, slots=True)
class FieldPair:
    """A field on the previous side, and the same field on the current side."""

    previous: Field
    current: Field


class MessagePair:
    """A message, or half of a service, that both sides have."""

    def __init__(
        self, previous_catalog: Catalog, previous: Message, current_catalog: Catalog, current: Message
    ) -> None:
        self._previous_catalog = previous_catalog
        self._current_catalog = current_catalog
        self.previous = previous
        self.current = current

    @property
    def name(self) -> str:
        """The name, the same on both sides."""
        return self.current.name

    @cached_property
    def differs(self) -> bool:
        """Whether any type or name in the message differs, at any depth."""
        return shape(self._previous_catalog, self.previous) != shape(self._current_catalog, self.current)

    @cached_property
    def has_same_comments(self) -> bool:
        """Whether both sides have the same field names with the same comments, as in most messages."""
        before, after = ([(each.name, each.comment) for each in side.fields] for side in (self.previous, self.current))
        return before == after

    @cached_property
    def recommented(self) -> tuple[FieldPair, ...]:
        """The fields that both sides have and whose comments differ."""
        if self.has_same_comments:
            return ()
        both = (*self.kept, *self.renamed)
        return tuple(pair for pair in both if pair.previous.comment != pair.current.comment)

    @cached_property
    def kept(self) -> tuple[FieldPair, ...]:
        """The fields with the same name on both sides, in the current order."""
        by_name = {field.name: field for field in self.previous.fields}
        return tuple(FieldPair(by_name[field.name], field) for field in self.current.fields if field.name in by_name)

    @cached_property
    def renamed(self) -> tuple[FieldPair, ...]:
        """The fields of the same type in the same bytes that were renamed, as their names or comments show."""
        fields = Candidates(self._lost, self._gained, [pair.current for pair in self.kept])
        return tuple(pair for pair in self._in_place if is_renamed(pair.previous, pair.current, fields))

    @cached_property
    def replaced(self) -> tuple[FieldPair, ...]:
        """The fields of the same type in the same bytes without evidence that they were renamed."""
        return tuple(pair for pair in self._in_place if pair not in self.renamed)

    @cached_property
    def removed(self) -> tuple[Field, ...]:
        """The fields that only the previous side has, except renamed fields."""
        renamed = [pair.previous for pair in self.renamed]
        return tuple(field for field in self._lost if field not in renamed)

    @cached_property
    def added(self) -> tuple[Field, ...]:
        """The fields that only the current side has, except renamed fields."""
        renamed = [pair.current for pair in self.renamed]
        return tuple(field for field in self._gained if field not in renamed)

    @cached_property
    def moved(self) -> tuple[FieldPair, ...]:
        """The smallest set of fields without which the other fields are in the same order on both sides."""
        order = [self.previous.fields.index(pair.previous) for pair in self.kept]
        stay = _longest_increasing(order)
        return tuple(pair for index, pair in enumerate(self.kept) if index not in stay)

    @cached_property
    def previous_layout(self) -> Layout | None:
        """The layout on the previous side; None if the size varies."""
        return _layout(self._previous_catalog, self.previous)

    @cached_property
    def current_layout(self) -> Layout | None:
        """The layout on the current side; None if the size varies."""
        return _layout(self._current_catalog, self.current)

    @cached_property
    def misread_by(self) -> tuple[Node, ...]:
        """The readers that decode wrong values from samples of the other side, without an error.

        Samples arrive padded to a multiple of 4 bytes, so sizes are rounded up before they are compared. A value is
        right if the other side has the same field, or the renamed field, in the same bytes. A value is wrong if the
        other side has padding there, because padding is not zero on the wire.
        """
        if not (self.previous_layout and self.current_layout):
            return ()
        if -(-self.previous_layout.size // 4) != -(-self.current_layout.size // 4):
            return ()
        before = {(self._current_path(path), *value) for path, *value in _values(self.previous_layout)}
        after = set(_values(self.current_layout))
        misread = {Node.OLD: before - after, Node.NEW: after - before}
        return tuple(reader for reader, values in misread.items() if values)

    @cached_property
    def nested(self) -> Mapping[str, MessagePair]:
        """The messages that kept and renamed fields nest, by the previous name of the field."""
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
        """Whether every value has the same offset and type on both sides, at every depth; names may differ."""
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
        """Pairs of fields with different names but the same type in the same bytes."""
        lost = {self._place(self.previous_layout, self.previous, field): field for field in self._lost}
        pairs = ((lost.get(self._place(self.current_layout, self.current, field)), field) for field in self._gained)
        return tuple(FieldPair(previous, field) for previous, field in pairs if previous)

    def _current_path(self, path: Path) -> Path:
        """Return the path on the current side of the value at `path` on the previous side, following renamed fields."""
        (name, index), inside = path[0], path[1:]
        if inside and name in self.nested:
            inside = self.nested[name]._current_path(inside)  # noqa: SLF001 - same class
        now = {pair.previous.name: pair.current.name for pair in self.renamed}
        return ((now.get(name, name), index), *inside)

    def _place(self, layout: Layout | None, message: Message, field: Field) -> tuple[str, object]:
        """Return the type and the place of a field: its extent, or the types before it if offsets vary."""
        if layout:
            return str(field.type), layout.extents()[field.name]
        before = message.fields[: message.fields.index(field)]
        return str(field.type), tuple(str(earlier.type) for earlier in before)


class Comparison:
    """Both sides, and the messages that correspond."""

    def __init__(self, previous: Side, current: Side) -> None:
        self.previous = previous
        self.current = current

    @cached_property
    def pairs(self) -> tuple[MessagePair, ...]:
        """The messages and halves of services that both sides have, sorted by name."""
        previous, current = self.previous.catalog, self.current.catalog
        before, after = definitions(previous), definitions(current)
        names = sorted(before.keys() & after)
        return tuple(MessagePair(previous, before[name], current, after[name]) for name in names)

    @cached_property
    def retagged(self) -> tuple[tuple[MessagePair, FieldPair], ...]:
        """The fields that have tags on both sides and whose comments differ, with all tags that can be inferred."""
        found = []
        for pair in self.pairs:
            for field in pair.recommented:
                current = self.current.inferred(pair.current, field.current)
                previous = self.previous.inferred(pair.previous, field.previous) if current.comment.attributes else None
                if previous and previous.comment.attributes:
                    found.append((pair, FieldPair(previous, current)))
        return tuple(found)

    @cached_property
    def renamed_messages(self) -> Mapping[str, str]:
        """The current names of messages that were renamed and not changed otherwise, by their previous names."""
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
        """The pairs in which any type or name differs, at any depth."""
        return tuple(pair for pair in self.pairs if pair.differs)

    @cached_property
    def topics(self) -> Mapping[str, tuple[str, ...]]:
        """The bridged topics of both sides that carry a message, also inside another one, by its name."""
        found: dict[str, dict[str, None]] = {}
        for side in (self.previous, self.current):
            for endpoint in endpoints(side.catalog):
                for message in (endpoint.message, *side.catalog.nested_all(endpoint.message)):
                    found.setdefault(message.name, {})[endpoint.entry.topic] = None
        return {name: tuple(sorted(topics)) for name, topics in found.items()}


def shape(catalog: Catalog, message: Message) -> Shape:
    """Return the types and names of the fields of a message, at every depth."""
    return tuple(
        (
            spelled(message, field.type),
            field.name,
            None if field.type.is_primitive else shape(catalog, catalog.nested(message, field.type)),
        )
        for field in message.fields
    )


def depth(comparison: Comparison, pair: MessagePair) -> int:
    """Return the number of levels of messages that a message nests on the current side."""
    catalog = comparison.current.catalog
    level, found = {pair.current.key: pair.current}, -1
    while level:
        fields = [(outer, field.type) for outer in level.values() for field in outer.fields]
        inner = [catalog.nested(outer, type_) for outer, type_ in fields if not type_.is_primitive]
        level, found = {message.key: message for message in inner}, found + 1
    return found


def _content(catalog: Catalog, message: Message) -> tuple[Shape, dict[str, tuple[str, Value]]]:
    """Return the contents of a definition, without its name, comments and version."""
    constants = {each.name: (str(each.type), each.value) for each in message.constants if each.name != VERSION}
    return shape(catalog, message), constants


def meaning(type_: FieldType) -> str:
    """Return the type of one element in a canonical spelling: `char` and `byte` are `uint8`."""
    return "uint8" if type_.base in OCTETS else type_.base


def has_same_length(pair: FieldPair) -> bool:
    """Whether both fields have the same kind of array and the same length."""
    before, after = pair.previous.type, pair.current.type
    return (before.array, before.length) == (after.array, after.length)


def spelled(outer: Message, type_: FieldType) -> str:
    """Return the type as the definition spells it, without the package if it is that of `outer`."""
    text = str(type_)
    return text.removeprefix(f"{outer.package}/") if type_.package else text


def constants_of(message: Message) -> dict[str, Constant]:
    """Return the constants by name."""
    return {constant.name: constant for constant in message.constants}


def definitions(catalog: Catalog) -> dict[str, Message]:
    """Return the messages and halves of services by name, except those of other packages, which are only nested."""
    halves = [half for service in catalog.own_services for half in (service.request, service.response)]
    return {message.name: message for message in (*catalog.uorb_messages, *halves)}


def _layout(catalog: Catalog, message: Message) -> Layout | None:
    return lay_out(catalog, message) if is_static(catalog, message) else None


def _values(layout: Layout) -> Iterator[tuple[Path, int, int, str]]:
    """Yield the path, the index in its array, the offset and the type of each value.

    A single message has the path of the first element of an array, because the bytes are the same.
    """
    for leaf in layout.leaves:
        path = tuple((name, index or 0) for name, index in leaf.path)
        for index in range(leaf.element_count):
            yield path, index, leaf.offset + index * leaf.size, meaning(leaf.type)


def _longest_increasing(numbers: list[int]) -> set[int]:
    """Return the positions of a longest increasing subsequence of `numbers`, which are all different."""
    ends: list[int] = []  # for each length, the position of the smallest number that ends a subsequence
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
