"""Databases of rosbag2 through sqlite3: their indexes, the columns of their tables, and logs of transactions."""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import tempfile
from contextlib import closing
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

from msggen.recordings.files.paths import LOGS

if TYPE_CHECKING:
    from collections.abc import Sequence

_LEAST_LENGTH = 1 << 20
"""The bytes that a value or a statement of the schema can always have. Larger ones have up to the size of the file."""
_STEPS = 10_000
"""The steps of sqlite3's machine between two looks at their number."""
_LEAST_STEPS, _STEPS_PER_BYTE = 1_000_000, 50
"""The most steps of a statement: so many, and further ones for each byte of the file. A row takes some ten."""
_COLUMN = re.compile(r"""\s*["'`\[]?(\w+)["'`\]]?""")
_TABLE = re.compile(r"[^(]*\((?P<columns>[^()]*)\)\s*$")


ERRORS = (sqlite3.Error, UnicodeDecodeError, OverflowError)
"""The errors of sqlite3 for a damaged database. Their messages can have names that are not UTF-8."""


class Statements:
    """A database that is read by statements, and not changed: no lock, no file beside it."""

    def __init__(self, path: str) -> None:
        self._size = os.path.getsize(path)
        self._address = f"file:{quote(os.fsencode(os.path.abspath(path)))}?immutable=1&mode=ro"

    def _rows_of(self, query: str, values: Sequence[int] = ()) -> list[Any]:
        """Return the rows of a statement, which has a connection of its own: a process may have few descriptors.

        What it takes is limited: a schema of strangers can have queries without end. Raises ERRORS.
        """
        with closing(sqlite3.connect(self._address, uri=True, check_same_thread=False)) as base:
            base.text_factory = bytes
            if hasattr(base, "setlimit"):  # Python 3.11
                base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(self._size, _LEAST_LENGTH))
            steps = iter(range(_LEAST_STEPS // _STEPS + self._size * _STEPS_PER_BYTE // _STEPS))
            base.set_progress_handler(lambda: next(steps, None) is None, _STEPS)
            try:
                base.execute("PRAGMA trusted_schema = OFF").fetchall()
                return base.execute(query, values).fetchall()
            except MemoryError:  # that is what sqlite3 says of some schemas, however much memory there is
                raise sqlite3.DatabaseError("the schema cannot be read") from None

    def span(self, time: str) -> tuple[int, int] | None:
        """Return the least and the largest time of `messages`, None if it has no rows. Raises ERRORS."""
        # two queries, each of which is a look into the index
        ((low,),), ((high,),) = (
            self._rows_of(f"SELECT {function}({time}) FROM messages")  # noqa: S608 - a known column
            for function in ("min", "max")
        )
        return (low, high) if isinstance(low, int) and isinstance(high, int) else None

    def ids_between(self, time: str, start: int, stop: int) -> tuple[int, int]:
        """Return the least and the largest rowid of the messages of a time. Raises ERRORS."""
        query = f"SELECT min(rowid), max(rowid) FROM messages WHERE {time} >= ? AND {time} < ?"  # noqa: S608
        ((low, high),) = self._rows_of(query, (start, stop))
        return (1, 0) if low is None else (low, high)

    def count(self) -> int:
        """Return the number of messages. Raises ERRORS."""
        return int(self._rows_of("SELECT count(*) FROM messages")[0][0])


class Column(NamedTuple):
    """A column of a table."""

    name: str
    is_id: bool
    """Whether the column is the rowid, which is not in the record."""


def columns_of(statement: str) -> list[Column] | None:
    """Return the columns that a simple CREATE TABLE names, None if there is more to it."""
    found = _TABLE.match(statement)
    if found is None or "--" in statement or "/*" in statement:
        return None
    columns = []
    for text in found["columns"].split(","):
        name = _COLUMN.match(text)
        words = text.upper().split()
        if name is None or words[:1] in (["PRIMARY"], ["UNIQUE"], ["CHECK"], ["FOREIGN"], ["CONSTRAINT"]):
            return None
        is_key = "PRIMARY" in words
        if is_key and (words[1:4] != ["INTEGER", "PRIMARY", "KEY"] or "DESC" in words):
            return None
        columns.append(Column(name[1].lower(), is_key))
    return columns


def has_log(path: str) -> bool:
    """Whether there may be transactions that are not in the file: it was not closed."""
    return any(_size(path + suffix) > least for suffix, least in LOGS.items())


def settle(path: str) -> tempfile.TemporaryDirectory[str]:
    """Copy a database with its logs to a folder, and let sqlite3 apply the logs to the copy, which keeps its name.

    Raises OSError, and ERRORS if a log is damaged.
    """
    folder = tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)
    try:
        copy = os.path.join(folder.name, os.path.basename(path))
        shutil.copyfile(path, copy)
        for suffix in LOGS:
            if _size(path + suffix):
                shutil.copyfile(path + suffix, copy + suffix)
        base = sqlite3.connect(copy)
        try:
            base.execute("SELECT count(*) FROM sqlite_master").fetchone()
            base.execute("PRAGMA journal_mode = DELETE").fetchone()
        finally:
            base.close()
    except BaseException:
        folder.cleanup()
        raise
    return folder


def _size(path: str) -> int:
    try:
        return os.path.getsize(path)
    except OSError:
        return 0
