"""How deep messages nest each other and how large they are, and the limits of both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic
from msggen.definitions.model import ArrayKind, Field, Message
from msggen.definitions.primitives import PRIMITIVES

MAX_SIZE = 2**16 - 1
"""Maximum size of a uORB message in bytes. uORB stores the size in 16 bits (docs/wire.md, 9)."""

MAX_OTHER_SIZE = 2**24
"""Maximum size of other messages in bytes. ROS 2 has no limit, but generated code creates each default value."""

MAX_VALUES = 2**16 - 1
"""Maximum number of values in a message and its nested messages. Generated code has a name for each value."""

MAX_TOTAL = 2 * MAX_VALUES
"""Maximum number of values of all definitions of a recording. Those of a release of PX4 have some 10,000 together."""

MAX_DEPTH = 64
"""Maximum depth of nesting. The deepest nesting in PX4 is 2."""


class Extent(NamedTuple):
    """The extent of a message or a field: bytes without padding, number of values, and levels of nesting.

    A field without a fixed size counts as 0 bytes, an array of numbers as one value.
    """

    size: int
    values: int
    depth: int = 0


def _nested(outer: Message, known: Mapping[str, Message]) -> Iterator[tuple[Field, Message]]:
    for field in outer.fields:
        inner = None if field.type.is_primitive else known.get(outer.key_of(field.type))
        if inner is not None:
            yield field, inner


def cycles(known: Mapping[str, Message]) -> Iterator[Diagnostic]:
    """Yield an error for each cycle and for nesting that is too deep.

    The search is depth first and not recursive, because the input may nest to any depth.
    """
    done: set[str] = set()
    for start in known.values():
        path = [start.key]
        stack = [_nested(start, known)]
        while stack and start.key not in done:
            step = next(stack[-1], None)
            if step is None:
                done.add(path.pop())
                stack.pop()
                continue
            field, inner = step
            if inner.key in path:
                cycle = [*path[path.index(inner.key) :], inner.key]
                is_short = len({key.split("/")[0] for key in cycle}) == 1
                names = [key.split("/")[1] if is_short else key for key in cycle]
                yield Diagnostic(field.location, "M302", f"messages nest each other: {' > '.join(names)}")
            elif len(path) == MAX_DEPTH:
                yield Diagnostic(
                    field.location, "M302", f"'{start.name}' nests messages more than {MAX_DEPTH} levels deep"
                )
                done.update(path)
            elif inner.key not in done:
                path.append(inner.key)
                stack.append(_nested(inner, known))


def too_large(
    message: Message, known: Mapping[str, Message], extents: dict[str, Extent], uorb: str = ""
) -> Iterator[Diagnostic]:
    """Yield the errors of a message that is too large or nests too deep. `uorb` is the package of uORB's messages.

    All that it nests must be known, and nothing may nest itself. `extents` are those that were computed before.
    """
    size, values, depth = extent_of(message, known, extents)
    if depth == MAX_DEPTH + 1:  # report only this message, not the messages that nest it
        yield Diagnostic(message.location, "M302", f"'{message.name}' nests messages more than {MAX_DEPTH} levels deep")
    is_of_uorb = message.package == uorb and message.folder == "msg"
    most = MAX_SIZE if is_of_uorb else MAX_OTHER_SIZE
    if size <= most and values <= MAX_VALUES:
        return
    if size > most:
        text = f"'{message.name}' has {size} bytes, {'uORB carries' if is_of_uorb else 'msggen accepts'} up to {most}"
    else:
        text = f"'{message.name}' has {values} values, msggen accepts up to {MAX_VALUES}"
    index = 0 if size > most else 1
    largest = max(message.fields, key=lambda field: _of_field(message, field, known, extents)[index])
    yield Diagnostic(largest.location, "M304", f"{text}: '{largest.type}' is too large")


def extent_of(message: Message, known: Mapping[str, Message], extents: dict[str, Extent]) -> Extent:
    """Return the extent of a message, and add it and those of what it nests to `extents`."""
    if message.key not in extents:
        fields = [_of_field(message, field, known, extents) for field in message.fields]
        values = max(1, sum(field.values for field in fields))
        depth = 1 + max((field.depth for field in fields), default=0)
        extents[message.key] = Extent(sum(field.size for field in fields), values, depth)
    return extents[message.key]


_REFERENCE = 8
"""Bytes per string in the default value of a fixed array: the size of a reference."""

_COUNTED = (ArrayKind.SCALAR, ArrayKind.FIXED)


def _of_field(outer: Message, field: Field, known: Mapping[str, Message], extents: dict[str, Extent]) -> Extent:
    type_ = field.type
    if type_.is_primitive:
        size = (PRIMITIVES[type_.name].size or _REFERENCE) * type_.element_count if type_.array in _COUNTED else 0
        return Extent(size, type_.element_count if type_.name == "bool" else 1)
    size, values, depth = extent_of(known[outer.key_of(type_)], known, extents)
    return Extent(size * type_.element_count if type_.is_fixed_size else 0, values * type_.element_count, depth)
