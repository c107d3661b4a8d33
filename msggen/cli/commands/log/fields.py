"""The fields of a topic of a recording: text for people, and objects of JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import few
from msggen.cli.table import Column, objects_of, print_table

if TYPE_CHECKING:
    from msggen.definitions.model import Message
    from msggen.recordings import Topic
    from msggen.recordings.columns.annotations import Annotation
    from msggen.recordings.decode.schemas import Schema


class _Field(NamedTuple):
    name: str
    """As `--field` takes it: `q`, `esc[0].esc_rpm`."""
    type: str
    about: Annotation


def _values(field: _Field) -> dict[str, str]:
    return {str(value): name for value, name in sorted(field.about.members.items())}


_FIELD_COLUMNS: Sequence[Column[_Field]] = (
    Column("name", "  name", lambda field: field.name, "  {}".format),
    Column("type", "type", lambda field: field.type),
    Column("unit", "unit", lambda field: "" if field.about.unit == "-" else field.about.unit),
    Column("frame", "frame", lambda field: field.about.frame),
    Column("values", "values", _values, lambda values: few([" ".join(each) for each in values.items()])),
    Column("flags", "", lambda field: field.about.is_flags),
)


def print_fields(topic: Topic) -> None:
    """Print the fields of a topic with types, units, frames and the names of values. Raises RecordingError."""
    fields = _fields_of(topic)
    print("fields")
    print_table(_FIELD_COLUMNS, fields)


def field_objects(topic: Topic) -> list[dict[str, Any]]:
    """Return the fields of a topic as objects of JSON. Raises RecordingError."""
    return objects_of(_FIELD_COLUMNS, _fields_of(topic))


def _fields_of(topic: Topic) -> list[_Field]:
    from msggen.recordings.decode.schemas import read_schema
    from msggen.recordings.source.source import RecordingError, SchemaError

    try:
        schema = read_schema(topic.ros_type, topic.definition)
    except SchemaError as error:
        raise RecordingError(f"{topic.label} cannot be decoded: {error}") from None
    return list(_fields(topic, schema, schema.message, ""))


def _fields(topic: Topic, schema: Schema, message: Message, front: str) -> Iterator[_Field]:
    """Yield the fields of a message. Of an array of messages, the first element stands for all."""
    from msggen.definitions.model import ArrayKind
    from msggen.recordings.columns.annotations import annotation_of

    indices = {ArrayKind.SCALAR: "", ArrayKind.FIXED: "[0]"}
    for field in message.fields:
        name = front + field.name
        yield _Field(name, str(field.type), annotation_of(topic, name))
        if not field.type.is_primitive:
            inner = f"{name}{indices.get(field.type.array, '[]')}."
            yield from _fields(topic, schema, schema.catalog.nested(message, field.type), inner)
