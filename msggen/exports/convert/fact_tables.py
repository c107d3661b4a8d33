"""What a ULog has beside its topics, as tables: parameters, texts, events and dropouts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msggen.exports.convert.facts import between
from msggen.exports.convert.names import DROPOUTS, EVENTS, PARAMETERS, TEXTS
from msggen.recordings.log.decoded_events import arguments_json
from msggen.recordings.source.source import FOREVER

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from msggen.recordings.log.log import Log
    from msggen.recordings.source.facts import Event, Facts, Text


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
    return _table(
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

    return _table(
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

    return _table(
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
    return _table(log, [dropout.time for dropout in facts.dropouts], duration=durations)


def _table(log: Log, times: Sequence[int], **columns: Any) -> Any:
    """Return a table with the columns of time that the tables of topics have, in front of others."""
    import pyarrow as pa

    boot, offset = log.facts.boot or 0, log.utc_offset
    kind = pa.timestamp("ns", "UTC")
    fields = [
        pa.field("timestamp", pa.uint64(), metadata={"unit": "us"}),
        pa.field("log_time", kind),
        *(
            pa.field(name, values.type, metadata={"unit": "s"} if name == "duration" else None)
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
