"""Samples as text, JSON and CSV, as `msggen topic echo` prints messages, without a generated package."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.base.foreign import csv_text, escaped, safe_json
from msggen.messages.formats import quoted_text, shortest, yaml_number
from msggen.recordings.columns.annotations import UNKNOWN, Annotation, annotation_of, annotations_of, without_indices
from msggen.recordings.columns.sql_names import names_for_sql
from msggen.recordings.decode.schemas import read_schema
from msggen.recordings.source.source import SchemaError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from msggen.definitions.model import Message
    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.decode.schemas import Schema
    from msggen.recordings.topics.topic import Topic


class Printer:
    """The samples of a topic as text or as values of JSON."""

    def __init__(self, topic: Topic) -> None:
        self._topic = topic
        self._annotations = annotations_of(topic.ros_type, topic.definition, topic.firmware)
        self._texts = dict(_texts(topic))

    def texts(self, samples: Samples) -> Iterator[str]:
        """Yield lines `name: value  # unit frame` for each sample, those of chosen columns or of all fields."""
        if samples.fields is None:
            for row in samples.array:
                yield "\n".join(self._lines(row, "", ""))
            return
        columns = self.columns(samples)
        kinds = {name: annotation_of(self._topic, name) for name in columns}
        for index in range(len(samples)):
            yield "\n".join(
                f"{name}: {_shown(values[index], kinds[name])}{_about(kinds[name])}" for name, values in columns.items()
            )

    def objects(self, samples: Samples) -> Iterator[dict[str, Any]]:
        """Yield the values of each sample as JSON has them: enums are numbers, what is not finite is None."""
        if samples.fields is None:
            yield from (self._object(row, "") for row in samples.array)
            return
        columns = self.columns(samples)
        for index in range(len(samples)):
            yield {name: json_value(values[index]) for name, values in columns.items()}

    def columns(self, samples: Samples) -> dict[str, Any]:
        """Return the chosen columns by name. All elements of a `char[N]` are one column of texts."""
        columns = samples.columns()
        fronts = {name: name.rpartition("[")[0] for name in columns}
        counts = Counter(fronts.values())
        found: dict[str, Any] = {}
        for name, values in columns.items():
            front = fronts[name]
            if not front or self._texts.get(without_indices(front)) != counts[front]:
                found[name] = values
            elif front not in found:
                rows = np.stack([columns[each] for each in columns if fronts[each] == front], axis=1)
                found[front] = [_text(row) for row in rows]
        return found

    def _lines(self, row: Any, front: str, indent: str) -> Iterator[str]:
        for name in row.dtype.names or ():
            value, path = row[name], front + name
            names = row.dtype[name].base.names
            if names is None:
                annotation = self._annotations.get(path, UNKNOWN)
                text = quoted_text(bytes(value)) if path in self._texts else _shown(value, annotation)
                yield f"{indent}{name}: {text}{_about(annotation)}"
            elif np.ndim(value) == 0:
                yield f"{indent}{name}:"
                yield from self._lines(value, f"{path}.", f"{indent}  ")
            else:
                yield f"{indent}{name}:"
                for element in value:
                    first, *others = self._lines(element, f"{path}.", f"{indent}  ")
                    yield f"{indent}- {first[len(indent) + 2 :]}"
                    yield from others

    def _object(self, row: Any, front: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name in row.dtype.names or ():
            value, path = row[name], front + name
            if row.dtype[name].base.names is None:
                found[name] = _text(value) if path in self._texts else json_value(value)
            elif np.ndim(value) == 0:
                found[name] = self._object(value, f"{path}.")
            else:
                found[name] = [self._object(element, f"{path}.") for element in value]
        return found


def _texts(topic: Topic) -> Iterator[tuple[str, int]]:
    """Yield the paths without indices, and N, of fields `char[N]`, which have text."""
    try:
        schema = read_schema(topic.ros_type, topic.definition)
    except SchemaError:
        return
    yield from _texts_in(schema, schema.message, "")


def _texts_in(schema: Schema, message: Message, front: str) -> Iterator[tuple[str, int]]:
    for field in message.fields:
        if not field.type.is_primitive:
            yield from _texts_in(schema, schema.catalog.nested(message, field.type), f"{front}{field.name}.")
        elif field.type.name == "char" and field.type.length:
            yield front + field.name, field.type.length


def _text(value: Any) -> str:
    return bytes(value).partition(b"\0")[0].decode(errors="replace")


def _shown(value: Any, annotation: Annotation) -> str:
    """Return a value as text: numbers and text as YAML has them, and values with a name as `4 (AUTO_LOITER)`."""
    if isinstance(value, str):
        return quoted_text(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_shown(each, UNKNOWN)}" for name, each in value.items()) + "}"
    if isinstance(value, (list, np.ndarray)):
        return "[" + ", ".join(_shown(each, annotation) for each in value) + "]"
    if isinstance(value, np.bool_):
        return "true" if value else "false"
    if isinstance(value, np.floating):
        return yaml_number(shortest(float(value)) if isinstance(value, np.float32) else repr(float(value)))
    name = member_name(annotation, int(value))
    return f"{value} ({name})" if name else str(value)


def member_name(annotation: Annotation, value: int) -> str:
    """Return the name of a value, or the names of its flags: `SPIKES|CELL_FAIL`. "" without names."""
    members = annotation.members
    if value in members or not members:
        return members.get(value, "")
    if not annotation.is_flags:
        return "unknown"
    found = [name for bit, name in sorted(members.items()) if bit and bit.bit_count() == 1 and value & bit]
    rest = value & ~sum(bit for bit in members if bit.bit_count() == 1)
    return "|".join([*found, *([f"{rest:#x}"] if found and rest else [])]) or ("unknown" if value else "")


def _about(annotation: Annotation) -> str:
    found = " ".join(filter(None, ("" if annotation.unit == "-" else annotation.unit, annotation.frame)))
    return f"  # {escaped(found)}" if found else ""


def json_value(value: Any) -> Any:
    """Return a value as JSON has it: null for NaN and infinite numbers."""
    if isinstance(value, dict):
        return {name: json_value(each) for name, each in value.items()}
    if isinstance(value, (list, np.ndarray)):
        return [json_value(each) for each in value]
    if isinstance(value, (float, np.floating)):
        if not np.isfinite(value):
            return None
        return float(shortest(float(value))) if isinstance(value, np.float32) else float(value)
    return value.item() if isinstance(value, np.generic) else value


class CsvRows:
    """Makes rows of CSV of samples, the first time with a line of names. The first column is the time in s."""

    def __init__(self, printer: Printer, *, sql_names: bool, quotes_formulas: bool) -> None:
        self._printer, self._sql_names, self._quotes_formulas = printer, sql_names, quotes_formulas
        self._has_names = False

    def lines(self, seconds: Sequence[float], samples: Samples) -> Iterator[str]:
        """Yield the rows of samples, whose times are `seconds`."""
        columns = self._printer.columns(samples)
        if not self._has_names and len(samples):
            self._has_names = True
            yield _line(self._names([*columns]))
        cells = [self._cells(values) for values in columns.values()]
        for row in zip(map(str, seconds), *cells, strict=True):
            yield _line(row)

    def _names(self, columns: list[str]) -> list[str]:
        names = ["time_" if "time" in columns else "time", *columns]
        return names_for_sql(names) if self._sql_names else names

    def _cells(self, values: Any) -> Iterable[str]:
        """Return the values of a column as text."""
        if isinstance(values, np.ndarray) and values.dtype != object:
            return map(_text_of(values.dtype), values.tolist())
        return map(self._cell, values)

    def _cell(self, value: Any) -> str:
        """Return a text, or what has no fixed size as JSON."""
        if isinstance(value, str):
            return csv_text(value, quotes_formulas=self._quotes_formulas)
        return safe_json(json.dumps(json_value(value), allow_nan=False))


def _text_of(dtype: np.dtype[Any]) -> Callable[[Any], str]:
    if dtype.kind == "b":
        return lambda value: "true" if value else "false"
    return shortest if dtype == np.float32 else str


def _line(cells: Iterable[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue()
