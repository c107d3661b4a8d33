"""Samples as CSV, as `msggen topic echo --csv` prints messages, without a generated package."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.base.foreign import csv_text, safe_json
from msggen.messages.formats import shortest
from msggen.recordings.columns.sql_names import names_for_sql
from msggen.recordings.columns.text import json_value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.columns.text import Printer


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
