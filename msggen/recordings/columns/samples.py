"""The samples of a topic: a structured array with times, as columns, as a table of Arrow, or as a data frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, overload

from msggen.base.diagnostics import counted
from msggen.base.missing import RECORDINGS, installed_by
from msggen.recordings.columns.arrays import check_fields, columns_of
from msggen.recordings.topics.choice import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    import numpy as np
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    from numpy.typing import NDArray

    from msggen.recordings.topics.topic import Topic

_LOG_TIME = "log_time"


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Samples of a topic, in the order of their log times. They can be pickled, and are valid without their log."""

    topic: Topic
    array: NDArray[Any]
    """A structured array with the fields of the message. Fields without a fixed size are objects: text, arrays and
    lists. The dtype can have padding: it is the layout of the samples."""
    log_times: NDArray[np.int64]
    """When each sample was recorded, in ns since 1970; in a ULog, since the start of the vehicle."""
    publish_times: NDArray[np.int64] | None
    """When each sample was published, in ns, None if the format does not have it."""
    fields: tuple[str, ...] | None = None
    """The fields that were chosen, None for all."""

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.array)

    def __repr__(self) -> str:
        """Return the topic, and the numbers of samples and fields."""
        fields = counted(len(self.array.dtype.names or ()), "field")
        return f"<Samples of {self.topic.label!r}: {counted(len(self), 'sample')}, {fields}>"

    def columns(self, *, times: bool = False, sql_names: bool = False) -> dict[str, NDArray[Any]]:
        """Return copies of the chosen columns by name, such as `gyro_rad[0]` and `esc[7].esc_rpm`.

        With `times`, the first ones are `log_time`, and `publish_time` if the format has it, in ns. They have `_`
        behind that if a field has this name. With `sql_names`, SQL takes the names without quotes: `gyro_rad_0`,
        `esc_7_esc_rpm`, and with `_` behind them if another column has this name or SQL has it for itself.
        """
        found = {**self._clocks(times=times), **columns_of(self.array, self.fields)}
        if not sql_names:
            return found
        from msggen.recordings.columns.sql_names import columns_for_sql

        return columns_for_sql(found)

    def _clocks(self, *, times: bool) -> dict[str, NDArray[np.int64]]:
        """Return copies of the columns with times, none without `times`."""
        clocks = {"log_time": self.log_times, "publish_time": self.publish_times} if times else {}
        taken = self.array.dtype.names or ()
        return {f"{name}_" if name in taken else name: each.copy() for name, each in clocks.items() if each is not None}

    def choose(self, fields: Collection[str] | None) -> Samples:
        """Return the same samples with only some fields, in their order. Raises RecordingError for an unknown field."""
        if fields is None:
            return replace(self, fields=None)
        chosen = listed(fields)
        check_fields(self.array.dtype, chosen)
        return replace(self, fields=tuple(chosen))

    def table(self, *, times: bool = False, sql_names: bool = False) -> pa.Table:
        """Return a table of Arrow (pyarrow.Table), with units and frames in the metadata of its fields.

        `times` and `sql_names` are as in `columns`.
        """
        with installed_by(RECORDINGS):
            import pyarrow as pa

        from msggen.recordings.columns.arrow import table_of

        table, clocks = table_of(self.topic, self.columns()), self._clocks(times=times)
        fields = [*(pa.field(name, pa.int64()) for name in clocks), *table.schema]
        arrays = [*map(pa.array, clocks.values()), *table.columns]
        made = pa.Table.from_arrays(arrays, schema=pa.schema(fields, table.schema.metadata))
        if not sql_names:
            return made
        from msggen.recordings.columns.sql_names import renamed_for_sql

        return renamed_for_sql(made)

    @overload
    def frame(self, library: Literal["pandas"] = ..., *, sql_names: bool = ...) -> pd.DataFrame: ...

    @overload
    def frame(self, library: Literal["polars"], *, sql_names: bool = ...) -> pl.DataFrame: ...

    def frame(self, library: str = "pandas", *, sql_names: bool = False) -> Any:
        """Return a data frame of `pandas` or `polars`. Raises ValueError for another library.

        Log times are the index of pandas, and a column in polars: in UTC, or in a ULog since the start of the vehicle.
        `sql_names` is as in `columns`.
        """
        is_ulog = self.topic.channels[0][1].is_of_uorb
        if library == "pandas":
            pd = _pandas()
            times = self.log_times
            index = (
                pd.TimedeltaIndex(times.view("m8[ns]")) if is_ulog else pd.DatetimeIndex(times.view("M8[ns]"), tz="UTC")
            )
            return pd.DataFrame(self.columns(sql_names=sql_names), index.rename(_LOG_TIME))
        frame = frame_of(library, self.columns, lambda: self.table(sql_names=sql_names))
        pl = _polars()
        kind = pl.Duration("ns") if is_ulog else pl.Datetime("ns", "UTC")
        name = f"{_LOG_TIME}_" if _LOG_TIME in frame.columns else _LOG_TIME
        return frame.insert_column(0, pl.Series(name, self.log_times).cast(kind))


def frame_of(library: str, columns: Callable[[], Mapping[str, Any]], table: Callable[[], Any]) -> Any:
    """Return a data frame: columns in `pandas`, or a table in `polars`. Raises ValueError for another library."""
    if library == "pandas":
        return _pandas().DataFrame(columns())
    if library == "polars":
        return _polars().from_arrow(table())
    raise ValueError(f"expected 'pandas' or 'polars', got {library!r}")


def _pandas() -> Any:
    with installed_by(RECORDINGS, "pandas"):
        import pandas as pd
    return pd


def _polars() -> Any:
    with installed_by(RECORDINGS, "polars"):
        import polars as pl
    return pl
