"""Samples of a topic that are read in pieces, as one array."""

from __future__ import annotations

from typing import Any

import numpy as np

from msggen.recordings.resident import large_empty
from msggen.recordings.samples import Samples, Topic

_FEW = 1024
_MOST = 64 << 20
"""The bytes of rows for which memory is taken before they are read: a damaged file can promise any number."""


class Collector:
    """The samples of a topic. `count` of them are expected, 0 if that is not known."""

    def __init__(self, topic: Topic, dtype: np.dtype[Any], count: int) -> None:
        self._topic, self._dtype = topic, dtype
        self._size = 0 if dtype.hasobject else dtype.itemsize
        self._least = min(count or _FEW, _MOST // max(dtype.itemsize, 16))
        """The rows for which memory is taken with the first ones: perhaps no sample fits the definition."""
        self._rows: Any = np.empty(0, np.uint8 if self._size else dtype)
        self._log_times: Any = np.empty(0, np.int64)
        self._publish_times: Any = np.empty(0, np.int64)
        self._count = 0

    def add(self, rows: Any, log_times: Any, publish_times: Any) -> None:
        """Add rows of `Decoder.rows` behind the others, with their times."""
        begin, end = self._count, self._count + len(rows)
        if end > len(self._log_times):
            self._grow(max(end, 2 * len(self._log_times), self._least))
        size = self._size
        if size:
            self._rows[begin * size : end * size] = rows.view(np.uint8)
        else:
            self._rows[begin:end] = rows
        self._log_times[begin:end] = log_times
        if publish_times is None:
            self._publish_times = None
        elif self._publish_times is not None:
            self._publish_times[begin:end] = publish_times
        self._count = end

    def samples(self) -> Samples:
        """Return all samples in the order of their log times. Call once."""
        end, times, published = self._count, self._log_times, self._publish_times
        rows = self._rows[: end * self._size].view(f"V{self._size}") if self._size else self._rows[:end]
        times, published = times[:end], None if published is None else published[:end]
        if (times[1:] < times[:-1]).any():
            order = np.argsort(times, kind="stable")
            rows, times = rows[order], times[order]
            published = None if published is None else published[order]
        return Samples(self._topic.without_log, rows.view(self._dtype), times, published)

    def _grow(self, count: int) -> None:
        for name, size in (("_rows", self._size or 1), ("_log_times", 1), ("_publish_times", 1)):
            old = getattr(self, name)
            if old is not None:
                new: Any = large_empty(count * size) if old.dtype == np.uint8 else np.empty(count * size, old.dtype)
                new[: self._count * size] = old[: self._count * size]
                setattr(self, name, new)
