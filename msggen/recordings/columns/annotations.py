"""What the fields of recorded messages mean: their units, frames, and the names of their values.

A definition in a recording seldom tells: a ULog has neither comments nor constants. What it lacks comes from embedded
releases. Those whose message has the same fields, in any order, come first. Among them, the release that is nearest to
the recorded firmware comes first, or the newest if the recording does not tell its firmware. Names of values change
from release to release: without that firmware, they only come from a message with the same fields.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from msggen.definitions.enumeration import Enumeration, enum_by_name, enumerations
from msggen.definitions.model import DEFAULT_PACKAGE, Comment, Field, InferredTag, Message
from msggen.definitions.tags import ENUM, INHERITED, UNIT
from msggen.recordings.decode.schemas import Schema, read_schema
from msggen.recordings.source.source import SchemaError
from msggen.sources.inferred import unit_in_sentences
from msggen.sources.released import nearest

if TYPE_CHECKING:
    from msggen.recordings.topics.topic import Topic

_INDEX = re.compile(r"\[\d+\]")


class Annotation(NamedTuple):
    """What the values of a field mean, as far as it is known."""

    unit: str = ""
    """The unit as definitions spell it: `m/s`."""
    frame: str = ""
    """The frame of reference: `NED`."""
    members: Mapping[int, str] = MappingProxyType({})
    """The names of values, or of bits: `{0: "MANUAL"}`."""
    is_flags: bool = False
    """Whether a value combines members, each of which is a bit."""


UNKNOWN = Annotation()


def annotation_of(topic: Topic, column: str) -> Annotation:
    """Return what the values of a column such as `esc[7].esc_rpm` mean."""
    return annotations_of(topic.ros_type, topic.definition, topic.firmware).get(without_indices(column), UNKNOWN)


def without_indices(column: str) -> str:
    """Return the path of the field of a column: `esc.esc_rpm` of `esc[7].esc_rpm`."""
    return _INDEX.sub("", column)


@lru_cache(256)
def annotations_of(ros_type: str, definition: str, firmware: str = "") -> Mapping[str, Annotation]:
    """Return what the values of each field mean, by paths without indices, such as `esc.esc_rpm`.

    `firmware` is the version that the recording tells: `v1.16.0`.
    """
    try:
        schema = read_schema(ros_type, definition)
    except SchemaError:
        return {}
    return dict(_annotations(schema, schema.message, "", firmware))


def _annotations(schema: Schema, recorded: Message, front: str, firmware: str) -> Iterator[tuple[str, Annotation]]:
    message = _completed(recorded, firmware)
    enums: dict[str, tuple[Mapping[int, str], bool]] = {}
    for each in enumerations(message):
        enums |= dict.fromkeys(each.fields, _members(each))
    for field in message.fields:
        if not field.type.is_primitive:
            nested = schema.catalog.nested(recorded, field.type)
            yield from _annotations(schema, nested, f"{front}{field.name}.", firmware)
            continue
        members, is_flags = enums.get(field.name, ({}, False))
        yield (
            front + field.name,
            Annotation(field.comment.tag(UNIT.name), field.comment.tag("frame"), members, is_flags),
        )


def _members(enum: Enumeration) -> tuple[Mapping[int, str], bool]:
    return {member.value: member.name for member in reversed(enum.members)}, enum.is_flags


def _completed(message: Message, firmware: str) -> Message:
    """Return a message with the constants and the tags of embedded definitions, where it has none of its own."""
    known = _embedded(message, firmware)
    if known and not message.constants and (firmware or _fields_of(known[0]) == _fields_of(message)):
        message = message._replace(constants=known[0].constants)
    return message._replace(fields=tuple(_with_tags(message, field, known) for field in message.fields))


def _with_tags(message: Message, field: Field, known: Sequence[Message]) -> Field:
    own = field.comment
    same = (each.comment for other in known for each in other.fields if _key(each) == _key(field))
    release = next(same, Comment())
    tags = {tag.name: own.tag(tag.name) or release.tag(tag.name) for tag in INHERITED}
    tags[UNIT.name] = own.unit or unit_in_sentences(message, field) or release.unit
    tags[ENUM.name] = tags[ENUM.name] or enum_by_name(message, field)
    inferred = tuple(InferredTag(name, content, "") for name, content in tags.items() if content and not own.tag(name))
    return field._replace(comment=Comment(own.text or release.text, own.unit, own.tags, inferred))


def _embedded(message: Message, firmware: str) -> list[Message]:
    """Return the messages of the same name in embedded releases: those with the same fields, then the nearest ones."""
    if message.package != DEFAULT_PACKAGE:
        return []
    own = _fields_of(message)
    found = (each.message for _, each in nearest(message.name, firmware))
    return sorted(found, key=lambda each: _fields_of(each) != own)  # stable


def _fields_of(message: Message) -> frozenset[tuple[str, str]]:
    """Return the fields in no order, because a ULog has them in the order of uORB's struct."""
    return frozenset(map(_key, message.fields))


def _key(field: Field) -> tuple[str, str]:
    return str(field.type).rpartition("/")[2], field.name
