"""The facts of recordings that are written as one: shifted to its times, cut, joined, and as tables.

The tables have what a ULog has beside its topics: parameters, texts, events and dropouts.
"""

from __future__ import annotations

from operator import itemgetter
from typing import TYPE_CHECKING, Any, TypeVar

from msggen.exports.convert.names import DROPOUTS, EVENTS, PARAMETERS, TEXTS
from msggen.recordings.log.decoded_events import arguments_json
from msggen.recordings.log.origin import vehicle_of
from msggen.recordings.source.source import FOREVER

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from msggen.recordings.log.log import Log
    from msggen.recordings.source.facts import Event, Facts, Text

    _Value = TypeVar("_Value")

_SECONDS = "duration", "time", "end"
"""The columns whose unit is s."""


def shifted(facts: Facts, offset: int) -> Facts:
    """Return the same facts with all times `offset` ns later."""
    return facts._replace(
        changed_parameters=[(time + offset, name, value) for time, name, value in facts.changed_parameters],
        texts=[each._replace(time=each.time + offset) for each in facts.texts],
        dropouts=[each._replace(time=each.time + offset) for each in facts.dropouts],
        start=None if facts.start is None else facts.start + offset,
    )


def between(facts: Facts, low: int, high: int) -> Facts:
    """Return the facts of a part, from `low` up to `high`, log times in ns. Its parameters are those at `low`."""
    return facts._replace(
        parameters=_parameters_at(facts, low),
        changed_parameters=[each for each in facts.changed_parameters if low <= each[0] < high],
        texts=[each for each in facts.texts if low <= each.time < high],
        dropouts=[each for each in facts.dropouts if low <= each.time < high],
    )


def joined(parts: Sequence[tuple[int, Facts]]) -> Facts | None:
    """Return the facts of several recordings with their starts, None if they are not of one vehicle.

    The parameters are those of the first recording; those that a later one has otherwise have changed at its start.
    Of information and defaults, those are left that are equal in all recordings.
    """
    (_, first), *others = parts = sorted(parts, key=itemgetter(0))
    vehicles = {vehicle_of(each.information) for _, each in parts}
    if others and (len(vehicles) > 1 or vehicles == {""}):
        return None
    for start, each in others:
        before = _parameters_at(first, start + 1)
        differing = [
            (start, name, value)
            for name, value in each.parameters.items()
            if name not in before or before[name] != value
        ]
        first = first._replace(
            changed_parameters=sorted(
                [*first.changed_parameters, *differing, *each.changed_parameters], key=itemgetter(0)
            ),
            default_parameters=_common(first.default_parameters, each.default_parameters),
            airframe_defaults=_common(first.airframe_defaults, each.airframe_defaults),
            information=_common(first.information, each.information),
            texts=sorted([*first.texts, *each.texts], key=itemgetter(0)),
            dropouts=sorted([*first.dropouts, *each.dropouts], key=itemgetter(0)),
            boot=first.boot if first.boot == each.boot else None,
        )
    return first


def _parameters_at(facts: Facts, time: int) -> dict[str, int | float]:
    """Return the parameters that a vehicle had before a log time in ns."""
    return {**facts.parameters, **{name: value for at, name, value in facts.changed_parameters if at < time}}


def _common(some: Mapping[str, _Value], others: Mapping[str, _Value]) -> dict[str, _Value]:
    return {name: value for name, value in some.items() if name in others and others[name] == value}


def fact_tables(log: Log, low: int, high: int) -> Iterator[tuple[str, Any]]:
    """Yield the names of the tables that have rows, and the tables (pyarrow.Table): from `low` up to `high` in ns."""
    if not log.has_facts:
        return
    begin = max(low, log.start)
    facts = between(log.facts, low, high)
    for name, table in (
        (PARAMETERS, _parameters(log, between(log.facts, begin, high), begin)),
        (TEXTS, _texts(log, [text for text in log.texts if low <= text.time < high])),
        (EVENTS, _events(log, [event for event in log.events if low <= event.time < high])),
        (DROPOUTS, _dropouts(log, facts)),
    ):
        if len(table):
            yield name, table


def _parameters(log: Log, facts: Facts, begin: int) -> Any:
    """Return a table of the values of parameters, each from a time on: at first from `begin`, a log time in ns."""
    import pyarrow as pa

    rows = [*((begin, name, value) for name, value in facts.parameters.items()), *facts.changed_parameters]
    names = [name for _, name, _ in rows]
    return timed_table(
        log,
        [time for time, _, _ in rows],
        name=pa.array(names, pa.string()),
        value=pa.array([float(value) for _, _, value in rows], pa.float64()),
        default=_defaults(log.facts, facts.airframe_defaults, names),
        firmware_default=_defaults(log.facts, facts.default_parameters, names),
    )


def _defaults(facts: Facts, known: Mapping[str, float], names: Sequence[str]) -> Any:
    """Return defaults of parameters. A log has only those that are not the values at its start."""
    import pyarrow as pa

    every = {**facts.parameters, **known} if facts.has_defaults else {}
    return pa.array([float(every[name]) if name in every else None for name in names], pa.float64())


def _texts(log: Log, texts: Sequence[Text]) -> Any:
    import pyarrow as pa

    return timed_table(
        log,
        [text.time for text in texts],
        level=pa.array([text.level for text in texts], pa.string()),
        text=pa.array([text.text for text in texts], pa.string()),
        tag=pa.array([text.tag for text in texts], pa.int64()),
    )


def _events(log: Log, events: Sequence[Event]) -> Any:
    """Return a table of events of all groups. What only metadata tells is NULL without it."""
    import pyarrow as pa

    def told(name: str) -> Any:
        return pa.array([getattr(event, name) if event.group else None for event in events], pa.string())

    return timed_table(
        log,
        [event.time for event in events],
        id=pa.array([event.number for event in events], pa.uint32()),
        sequence=pa.array([event.sequence for event in events], pa.uint16()),
        level=pa.array([event.level for event in events], pa.string()),
        external_level=pa.array([event.external_level for event in events], pa.string()),
        text=pa.array([event.text for event in events], pa.string()),
        name=told("name"),
        group=told("group"),
        description=told("description"),
        arguments=pa.array([arguments_json(event.arguments) if event.group else None for event in events], pa.string()),
    )


def _dropouts(log: Log, facts: Facts) -> Any:
    import pyarrow as pa

    durations = pa.array([dropout.duration / 1e9 for dropout in facts.dropouts], pa.float64())
    return timed_table(log, [dropout.time for dropout in facts.dropouts], duration=durations)


def timed_table(log: Log, times: Sequence[int], **columns: Any) -> Any:
    """Return a table with the columns of time that the tables of topics have, for log times in ns, before others."""
    import pyarrow as pa

    boot, offset = log.facts.boot or 0, log.utc_offset
    kind = pa.timestamp("ns", "UTC")
    fields = [
        pa.field("timestamp", pa.uint64(), metadata={"unit": "us"}),
        pa.field("log_time", kind),
        *(
            pa.field(name, values.type, metadata={"unit": "s"} if name in _SECONDS else None)
            for name, values in columns.items()
        ),
    ]
    arrays = [
        pa.array([max(time - boot, 0) // 1000 for time in times], pa.uint64()),
        pa.nulls(len(times), kind)
        if offset is None
        else pa.array([min(time + offset, FOREVER) for time in times], kind),
        *columns.values(),
    ]
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
