"""Samples of a topic that are read in pieces, as one array."""

from __future__ import annotations

from typing import Any

import numpy as np

from msggen.recordings.columns.samples import Samples
from msggen.recordings.source.memory import large_empty
from msggen.recordings.topics.topic import Topic

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
        self._rows: Any = None
        self._log_times: Any = None
        self._publish_times: Any = None
        self._room = self._count = 0

    def add(self, rows: Any, log_times: Any, publish_times: Any) -> None:
        """Add rows of `Decoder.rows` behind the others, with their times."""
        if not self._room and len(rows) == self._least and self._size and rows.flags.owndata:
            self._adopt(rows, log_times, publish_times)
            return
        begin, end = self._count, self._count + len(rows)
        if end > self._room:
            self._grow(max(end, 2 * self._room, self._least), has_published=publish_times is not None)
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
        if not self._room:
            self._grow(0, has_published=True)
        end, times, published = self._count, self._log_times, self._publish_times
        rows = self._rows[: end * (self._size or 1)]
        times, published = times[:end], None if published is None else published[:end]
        if np.logical_or.reduce(times[1:] < times[:-1]):
            order = np.argsort(times, kind="stable")
            rows = rows.view(f"V{self._size}") if self._size else rows  # copies the padding, too
            rows, times = rows[order], times[order]
            published = None if published is None else published[order]
        if self._size:
            rows = np.ndarray(end, self._dtype, rows)  # as `view` does in several times as long
        return Samples(self._topic.without_log, rows, times, published)

    def _adopt(self, rows: Any, log_times: Any, publish_times: Any) -> None:
        """Take rows that are new and all that are expected, without a copy. Times can be those of the file."""
        self._rows = rows.view(np.uint8)
        self._log_times = np.array(log_times)
        self._publish_times = None if publish_times is None else np.array(publish_times)
        self._room = self._count = len(rows)

    def _grow(self, count: int, *, has_published: bool) -> None:
        old, old_times, old_published, end = self._rows, self._log_times, self._publish_times, self._count
        self._rows = large_empty(count * self._size) if self._size else np.empty(count, self._dtype)
        self._log_times = np.empty(count, np.int64)
        self._publish_times = np.empty(count, np.int64) if has_published else None
        if end:
            size = end * (self._size or 1)
            self._rows[:size] = old[:size]
            self._log_times[:end] = old_times[:end]
            if old_published is None:
                self._publish_times = None
            elif has_published:
                self._publish_times[:end] = old_published[:end]
        self._room = count
