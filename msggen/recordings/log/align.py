"""Samples of several topics side by side: each sample of the first topic with those of the others at that time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from msggen.base.diagnostics import counted, suggestion
from msggen.base.missing import RECORDINGS, installed_by
from msggen.recordings.columns.samples import Samples, frame_of
from msggen.recordings.columns.sql_names import columns_for_sql, renamed_for_sql
from msggen.recordings.log.origin import YEAR_2001
from msggen.recordings.source.source import RecordingError
from msggen.recordings.topics.choice import listed
from msggen.recordings.topics.find import by_name, find

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    from numpy.typing import NDArray

    from msggen.recordings.topics.topic import Topic

    Times = NDArray[np.int64]

Direction = Literal["latest", "nearest"]
"""Which sample of another topic belongs to a time: the latest one up to it, or the nearest one."""

TIME = "time"
"""The name of the first column."""
_OWN = "timestamp"
_CLOCKS = ("log_time", "publish_time")
_LARGEST = 1 << 62
"""A time in ns whose difference from any other fits into 64 bits."""


@dataclass(frozen=True, eq=False, repr=False)
class Aligned:
    """Samples of several topics side by side, in the order of the times of the first topic."""

    times: Times
    """The time of each row in ns, by the clock that was chosen."""
    samples: Mapping[str, Samples]
    """The samples of each topic by its name in the columns: as many for each as there are rows."""
    unmatched: Mapping[str, int]
    """How many samples of the first topic have no partner in each other topic. They are in no row."""
    dropped: int
    """How many samples of the first topic were dropped because some topic has no partner within the tolerance."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.times)

    def __repr__(self) -> str:
        """Return the topics and the number of rows."""
        return f"<Aligned {', '.join(self.samples)}: {counted(len(self), 'row')}>"

    def __str__(self) -> str:
        """Return one line for a user."""
        missing = [f"{count} in {name}" for name, count in self.unmatched.items() if count]
        return f"{counted(len(self), 'row')}, {self.dropped} dropped" + (
            f", no partner for {', '.join(missing)}" if missing else ""
        )

    @property
    def array(self) -> NDArray[Any]:
        """A structured array: `time`, and a field for each topic with the fields of its message."""
        kinds = [(name, samples.array.dtype) for name, samples in self.samples.items()]
        found = np.empty(len(self), np.dtype([(TIME, np.dtype(np.int64)), *kinds]))
        found[TIME] = self.times
        for name, samples in self.samples.items():
            if samples.array.dtype.hasobject:
                found[name] = samples.array
            elif samples.array.dtype.itemsize:
                row = f"V{samples.array.dtype.itemsize}"  # numpy copies overlapping fields wrongly
                found[name].view(row)[...] = samples.array.view(row)
        return found

    def choose(self, fields: Collection[str]) -> Aligned:
        """Return the same rows with only some fields, such as `vehicle_attitude.q`. Raises RecordingError.

        Topics have all their names. A topic alone stands for all of its fields.
        """
        chosen: dict[str, list[str] | None] = {}
        for path in listed(fields):
            name, field = self._split(path)
            known = chosen.setdefault(name, [])
            if not field:
                chosen[name] = None
            elif known is not None:
                known.append(field)
        samples = {name: each.choose(chosen[name]) for name, each in self.samples.items() if name in chosen}
        return replace(self, samples=samples)

    def _split(self, path: str) -> tuple[str, str]:
        """Return the topic of a path, by its name in the columns, and the field, "" for all. Raises RecordingError."""
        for name in self.samples:
            if f"{path}.".startswith(f"{name}."):
                return name, path[len(name) + 1 :]
        topic, _, field = path.partition(".")
        names = {samples.topic: name for name, samples in self.samples.items()}
        return names[find(by_name(list(names)), topic)], field

    def columns(self, *, sql_names: bool = False) -> dict[str, NDArray[Any]]:
        """Return the columns by name: `time`, and those of the topics, such as `vehicle_attitude.q[0]`.

        `sql_names` is as in `Samples.columns`: `vehicle_attitude_q_0`.
        """
        found: dict[str, NDArray[Any]] = {TIME: self.times.copy()}
        for name, samples in self.samples.items():
            found.update((f"{name}.{column}", values) for column, values in samples.columns().items())
        return columns_for_sql(found) if sql_names else found

    def table(self, *, sql_names: bool = False) -> pa.Table:
        """Return a table of Arrow (pyarrow.Table), with units and frames in the metadata of its fields.

        `sql_names` is as in `columns`.
        """
        with installed_by(RECORDINGS):
            import pyarrow as pa
        fields, columns = [pa.field(TIME, pa.int64())], [pa.array(self.times)]
        for name, samples in self.samples.items():
            table = samples.table()
            fields += [field.with_name(f"{name}.{field.name}") for field in table.schema]
            columns += table.columns
        made = pa.table(columns, schema=pa.schema(fields))
        return renamed_for_sql(made) if sql_names else made

    @overload
    def frame(self, library: Literal["pandas"] = ..., *, sql_names: bool = ...) -> pd.DataFrame: ...

    @overload
    def frame(self, library: Literal["polars"], *, sql_names: bool = ...) -> pl.DataFrame: ...

    def frame(self, library: str = "pandas", *, sql_names: bool = False) -> Any:
        """Return a data frame of `pandas` or `polars`, with names as in `columns`. Raises ValueError for others."""
        columns, table = (partial(each, sql_names=sql_names) for each in (self.columns, self.table))
        return frame_of(library, columns, table)


def align(samples: Sequence[Samples], tolerance: float, by: str | None, direction: Direction) -> Aligned:
    """Return the samples of the first topic with their partners. Log.align describes it. Raises RecordingError."""
    if direction not in ("latest", "nearest"):
        raise RecordingError(f"expected the direction 'latest' or 'nearest', got '{direction}'")
    limit = round(min(tolerance * 1e9, _LARGEST))
    clock = _clock_of(samples) if by is None else by
    names = _names_of([each.topic for each in samples])
    first, *others = (times_of(each, clock) for each in samples)
    order = np.argsort(first, kind="stable")
    first = first[order]
    indices = [order, *(partners(first, other, limit, direction) for other in others)]
    has_all = np.logical_and.reduce([found >= 0 for found in indices])
    return Aligned(
        times=first[has_all],
        samples={
            name: rows_of(each, found[has_all]) for name, each, found in zip(names, samples, indices, strict=True)
        },
        unmatched={name: int((found < 0).sum()) for name, found in zip(names[1:], indices[1:], strict=True)},
        dropped=int((~has_all).sum()),
    )


def partners(times: Times, others: Times, tolerance: int, direction: Direction) -> NDArray[np.intp]:
    """Return for each of `times` the index of its partner in `others`, -1 if none is within the tolerance.

    Both can be in any order. Of several others with the same time, the last one is the partner; of two that are
    equally near, the earlier one.
    """
    if not len(others):
        return np.full(len(times), -1, np.intp)
    order = np.argsort(others, kind="stable")
    ordered = others[order]
    found = np.searchsorted(ordered, times, side="right") - 1
    if direction == "nearest":
        following = np.minimum(found + 1, len(ordered) - 1)
        following = np.searchsorted(ordered, ordered[following], side="right") - 1
        is_nearer = (ordered[following] - times) < (times - ordered[found])
        found = np.where((found < 0) | ((following > found) & is_nearer), following, found)
    fits = (found >= 0) & (np.abs(ordered[found] - times) <= tolerance)
    return np.where(fits, order[found], -1)


def times_of(samples: Samples, clock: str) -> Times:
    """Return the times of samples in ns: `log_time`, `publish_time`, or a field with microseconds.

    Raises RecordingError if they do not have it.
    """
    topic = samples.topic
    if clock == "log_time":
        found: Any = samples.log_times
    elif clock == "publish_time":
        found = samples.publish_times
        if found is None:
            raise RecordingError(f"'{topic.name}' has no publish times: align by timestamp or log_time")
    else:
        dtype = samples.array.dtype
        if not _has_time(samples, clock):
            names = [*_CLOCKS, *(name for name in dtype.names or () if _has_time(samples, name))]
            raise RecordingError(f"'{topic.name}' has no time '{clock}'{suggestion(clock, names)}")
        limited = np.minimum(samples.array[clock], np.asarray(_LARGEST // 1000, dtype[clock]))
        found = limited.astype(np.int64) * 1000
    times: Times = np.clip(found, -_LARGEST, _LARGEST)
    return times


def _clock_of(samples: Sequence[Samples]) -> str:
    """Return the time by which samples are aligned if none is named: their own, if all have it from one clock.

    Those of a vehicle on Zenoh are since its boot, and those of programs that send to it since 1970.
    """
    if not all(_has_time(each, _OWN) for each in samples):
        return "log_time"
    clocks = {bool(np.median(each.array[_OWN]) < YEAR_2001) for each in samples if len(each.array)}
    return _OWN if len(clocks) <= 1 else "log_time"


def _has_time(samples: Samples, name: str) -> bool:
    dtype = samples.array.dtype
    return name in (dtype.names or ()) and dtype[name] == np.dtype(np.uint64)


def _names_of(topics: Sequence[Topic]) -> list[str]:
    """Return the names in columns: those in uORB, or else those in the recording where several would be the same.

    A topic that is called as the column of times has `_` behind its name.
    """
    short = [f"{topic.uorb}_{topic.instance}" if topic.instance else topic.uorb for topic in topics]
    counts = Counter(short)
    names = [name if counts[name] == 1 else topic.label for name, topic in zip(short, topics, strict=True)]
    for name, count in Counter(names).items():
        if count > 1:
            raise RecordingError(f"'{name}' is named {count} times")
    return [f"{name}_" if name == TIME else name for name in names]


def rows_of(samples: Samples, indices: NDArray[Any] | slice) -> Samples:
    """Return some of the samples, by their indices, by an array of bools or a slice."""
    rows = samples.array
    is_plain = rows.dtype.itemsize > 0 and not rows.dtype.hasobject
    # rows of bytes keep the padding, which numpy does not copy for structured arrays
    chosen = rows.view(f"V{rows.dtype.itemsize}")[indices].view(rows.dtype) if is_plain else rows[indices]
    published = samples.publish_times
    return replace(
        samples,
        array=chosen,
        log_times=samples.log_times[indices],
        publish_times=None if published is None else published[indices],
    )
