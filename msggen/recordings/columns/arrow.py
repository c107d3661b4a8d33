"""Samples as tables of Arrow, with what the values mean as metadata.

The metadata of a field has `unit`, `frame` and `enum` as far as they are known (annotations.py). `enum` is JSON such as
`{"0": "MANUAL"}`, and `flags` is "true" if its members are bits. The metadata of a table has
`topic`, `instance` and `type`.
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from msggen.definitions.model import ArrayKind, FieldType, Message
from msggen.definitions.primitives import PRIMITIVES
from msggen.recordings.columns.annotations import Annotation, annotation_of, without_indices
from msggen.recordings.decode.schemas import read_schema

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    import numpy as np
    import pyarrow as pa
    from numpy.typing import NDArray

    from msggen.recordings.decode.schemas import Schema
    from msggen.recordings.topics.topic import Topic

    Clocks = tuple[NDArray[np.int64], NDArray[np.int64] | None]
    """Log times, and publish times if the format has them."""


def table_of(topic: Topic, columns: Mapping[str, Any], clocks: Clocks | None = None, utc_offset: int | None = 0) -> Any:
    """Return a table (pyarrow.Table) with columns of a topic, the one called `timestamp` first.

    `clocks`, the log times and publish times, add the columns `log_time` and `publish_time` in UTC, with `_` behind
    that if a field has this name. `utc_offset` in ns is added to both. They are NULL if it is None, and so is
    `publish_time` if the format has none.
    """
    import pyarrow as pa

    has_objects = any(values.dtype == object for values in columns.values())
    types = _types_of(topic.ros_type, topic.definition) if has_objects else {}
    front = [_column(topic, "timestamp", columns["timestamp"], types)] if "timestamp" in columns else []
    times = [] if clocks is None else list(_time_columns(clocks, columns, utc_offset))
    others = [_column(topic, name, values, types) for name, values in columns.items() if name != "timestamp"]
    every = [*front, *times, *others]
    fields, arrays = [field for field, _ in every], [array for _, array in every]
    described = {"topic": topic.name, "instance": str(topic.instance), "type": topic.ros_type}
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields, described))


def _time_columns(
    clocks: Clocks, names: Collection[str], utc_offset: int | None
) -> Iterator[tuple[pa.Field[Any], Any]]:
    import pyarrow as pa

    kind = pa.timestamp("ns", "UTC")
    for name, values in zip(("log_time", "publish_time"), clocks, strict=True):
        known = None if values is None or utc_offset is None else values + utc_offset
        array = pa.nulls(len(clocks[0]), kind) if known is None else pa.array(known, kind)
        yield pa.field(f"{name}_" if name in names else name, kind), array


def _column(topic: Topic, name: str, values: Any, types: Mapping[str, Any]) -> tuple[pa.Field[Any], Any]:
    import pyarrow as pa

    is_object = values.dtype == object
    type_ = types[without_indices(name)] if is_object else pa.from_numpy_dtype(values.dtype)
    return _field(topic, name, type_), _of_objects(values.tolist(), type_) if is_object else pa.array(values, type_)


def _of_objects(values: list[Any], type_: Any) -> Any:
    """Return values of variable size as an array of Arrow. It has only UTF-8: other bytes in text become U+FFFD."""
    import pyarrow as pa

    try:
        return pa.array(values, type_)
    except UnicodeEncodeError:
        return pa.array(_clean(values), type_)


def _clean(value: Any) -> Any:
    """Return values with U+FFFD in place of surrogates."""
    if isinstance(value, str):
        return value.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")
    if isinstance(value, list):
        return [_clean(each) for each in value]
    return {name: _clean(each) for name, each in value.items()} if isinstance(value, dict) else value


def _field(topic: Topic, name: str, type_: Any) -> Any:
    import pyarrow as pa

    annotation = annotation_of(topic, name)
    return pa.field(name, type_, metadata=_metadata(annotation))


def _metadata(annotation: Annotation) -> dict[str, str]:
    members = {str(value): name for value, name in sorted(annotation.members.items())}
    found = {
        "unit": annotation.unit,
        "frame": annotation.frame,
        "enum": json.dumps(members) if members else "",
        "flags": "true" if annotation.is_flags else "",
    }
    return {key: text for key, text in found.items() if text}


@lru_cache(256)
def _types_of(ros_type: str, definition: str) -> dict[str, Any]:
    """Return the types of Arrow by paths without indices, of the fields without a fixed size among others."""
    schema = read_schema(ros_type, definition)
    return dict(_types(schema, schema.message, ""))


def _types(schema: Schema, message: Message, front: str) -> Iterator[tuple[str, Any]]:
    for field in message.fields:
        yield front + field.name, _type(schema, message, field.type)
        if not field.type.is_primitive:
            yield from _types(schema, schema.catalog.nested(message, field.type), f"{front}{field.name}.")


def _type(schema: Schema, outer: Message, type_: FieldType) -> Any:
    """Return the type of Arrow of a field: text, a list, a struct, or a number."""
    import pyarrow as pa

    if not type_.is_primitive:
        inner = schema.catalog.nested(outer, type_)
        base = pa.struct([(field.name, _type(schema, inner, field.type)) for field in inner.fields])
    elif PRIMITIVES[type_.name].is_string:
        base = pa.string()
    else:
        base = pa.from_numpy_dtype(PRIMITIVES[type_.name].code)
    return base if type_.array is ArrayKind.SCALAR else pa.list_(base)
