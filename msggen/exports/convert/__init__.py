"""Recordings in other formats: tables of Parquet, Arrow and CSV, and recordings of ROS 2 as MCAP files or folders."""

from __future__ import annotations

import errno
import os
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from msggen.base.disk.staging import check_writable, clear, locked, stage_beside, staging_folder
from msggen.base.disk.urls import is_in_store
from msggen.base.missing import RECORDINGS, installed_by
from msggen.base.recording_formats import STORAGES
from msggen.exports.convert.selection import EVERYTHING, Converted, Selection
from msggen.recordings.source.source import RecordingError
from msggen.recordings.topics.choice import check_times, listed

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from contextlib import AbstractContextManager

    from msggen.recordings.log.log import Key, Log
    from msggen.recordings.topics.topic import Topic

__all__ = ["EVERYTHING", "FORMATS", "TABLES", "TABLE_SUFFIXES", "Converted", "Selection", "convert", "join"]

TABLES = ("parquet", "arrow", "csv")
"""The formats with a file for each topic."""
FORMATS = (*TABLES, "mcap", "rosbag2")
"""The formats that are written. `mcap` is a file, and the others are folders, also of tables of several topics."""
TABLE_SUFFIXES = MappingProxyType({".parquet": "parquet", ".arrow": "arrow", ".feather": "arrow", ".csv": "csv"})
"""The formats of tables by the suffixes of files."""


def convert(  # noqa: PLR0913 - named options
    log: Log,
    target: str,
    *,
    format: str,  # noqa: A002 - as pandas and xarray name it
    topics: Iterable[Key | Topic] | None = None,
    start: float | None = None,
    stop: float | None = None,
    fields: Collection[str] | None = None,
    quotes_formulas: bool = False,
    sql_names: bool = False,
    storage: str = STORAGES[0],
    progress: Callable[[float], None] = lambda _: None,
) -> Converted:
    """Write a recording in another format, one of FORMATS, to `target`: a file for `mcap`, otherwise a folder.

    A table of a single topic is a file if `target` ends as such files do: `wind.csv`, `wind.feather` for `arrow`.

    `topics`, `start` and `stop` choose as for `Log.load`, and `fields` the columns of tables: of each topic those that
    it has. `progress` is called with the share that is done, from 0 to 1. The recording is read piece by piece.

    Characters of text that are not printable are escapes in `csv`. With `quotes_formulas`, `'` precedes text there that
    a spreadsheet would evaluate. With `sql_names`, the columns of tables have names as in `Samples.columns`.
    `storage` is as for `join`.

    `target` can be an address in a store, such as "s3://bucket/flight.mcap": files are written to a temporary folder,
    and put there whole.

    The target is written under another name beside it, which is removed at the end or by the next run, and then
    renamed: there is never a part of it, and without samples nothing. Raises RecordingError, FileExistsError if there
    is such a target, FileNotFoundError if there is no folder for it, and OSError, also if another process writes it.
    """
    if format not in FORMATS:
        raise ValueError(f"expected one of {', '.join(FORMATS)}, got {format!r}")
    check_times(start, stop)
    chosen = None if topics is None else listed(topics)
    selection = Selection(chosen, start, stop, None if fields is None else listed(fields))
    if format not in TABLES:
        return join([log], target, selection, format, progress, storage=storage)
    with installed_by(RECORDINGS):
        import pyarrow  # noqa: F401, ICN001
    from msggen.exports.convert.tables import Format, write_tables

    is_file = TABLE_SUFFIXES.get(os.path.splitext(target)[1].lower()) == format
    kind = Format(format, quotes_formulas=quotes_formulas, is_file=is_file, sql_names=sql_names)
    return _whole(target, lambda made: write_tables(log, made, kind, selection, progress))


def join(  # noqa: PLR0913 - named options
    logs: Sequence[Log],
    target: str,
    selection: Selection = EVERYTHING,
    format: str = "mcap",  # noqa: A002 - as above
    progress: Callable[[float], None] = lambda _: None,
    *,
    storage: str = STORAGES[0],
) -> Converted:
    """Write several recordings as one, in the order of their log times: `mcap` or `rosbag2`.

    `storage` is that of rosbag2: `mcap`, or `sqlite3` for a database, which has no place for attachments and metadata.
    Times of `selection` are in s after the start of the first of them. See `convert`, also for the errors.
    """
    with installed_by(RECORDINGS):
        from msggen.exports.convert.recording import write_mcap
        from msggen.exports.convert.rosbag2 import write_rosbag2
    if selection.fields is not None:
        raise RecordingError(f"fields can be chosen for {', '.join(TABLES)}, in {format} samples are whole")
    if storage not in STORAGES:
        raise ValueError(f"expected one of {', '.join(STORAGES)}, got {storage!r}")
    write = write_mcap if format == "mcap" else partial(write_rosbag2, storage=storage)
    return _whole(target, lambda made: write(logs, made, selection, progress))


def _whole(target: str, write: Callable[[str], Converted]) -> Converted:
    """Call `write` with a path for a file or folder, and move what it made to `target` if that has samples."""
    if is_in_store(target):
        from msggen.exports.convert.stored import write_stored

        return write_stored(target, write)
    target = os.path.abspath(target)
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, "there is such a file or folder already", target)
    parent, name = os.path.split(target)
    if not os.path.isdir(parent):
        raise FileNotFoundError(errno.ENOENT, "there is no such folder", parent)
    check_writable(parent)
    stage = stage_beside(target)
    if os.path.isdir(stage):
        with _alone(stage):
            clear(stage)
    with staging_folder(stage) as folder, _alone(stage):
        made = os.path.join(folder, name)
        written = write(made)
        if not written.rows:
            return written._replace(files=[])
        size = sum(map(os.path.getsize, written.files))
        os.rename(made, target)
    files = [target if path == made else os.path.join(target, os.path.relpath(path, made)) for path in written.files]
    return written._replace(files=files, size=size)


def _alone(stage: str) -> AbstractContextManager[None]:
    """Lock a staging folder. Raises OSError if another process has it."""

    def refuse() -> None:
        raise OSError(errno.EBUSY, "another conversion writes to this path", stage)

    return locked(stage, refuse)
