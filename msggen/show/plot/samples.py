"""The newest samples of a topic, in as much memory as a window of time needs."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from msggen.recordings.log.series import Series
from msggen.show.plot.fields import Number

MOST = 1_000_000
"""The most samples of a topic that are kept, however long the window is."""
_CODES = {"?": "B"}
"""The types of arrays, where they are not those of `struct`."""


class Samples:
    """Numbers of the messages of a topic, by time in s. Keeps `window` s, and the sample before them."""

    def __init__(self, numbers: Mapping[str, Number], window: float) -> None:
        """Make an empty one. The keys of `numbers` are the labels of its series."""
        self._numbers, self._window = numbers, window
        self._times = array("d")
        self._values: Sequence[array[Any]] = [array(_CODES.get(each.code, each.code)) for each in numbers.values()]

    def __len__(self) -> int:
        return len(self._times)

    def add(self, time: float, message: Any) -> None:
        """Add a message, if it has all elements. If the clock was set back, those after it are forgotten."""
        try:
            found = [number.get(message) for number in self._numbers.values()]
        except IndexError:  # a sequence is shorter
            return
        self._keep(0, bisect_right(self._times, time))
        self._times.append(time)
        for values, value in zip(self._values, found, strict=True):
            values.append(value)
        old = max(bisect_left(self._times, time - self._window) - 1, len(self._times) - MOST)
        if old > len(self._times) // 2:  # seldom: the rest moves to the front
            self._keep(old, len(self._times))

    def _keep(self, begin: int, end: int) -> None:
        for values in (self._times, *self._values):
            del values[end:], values[:begin]

    def series(self, low: float, end: float) -> list[Series]:
        """Return the numbers from `low` to `end`, none if there are no samples. A value lasts until the next one."""
        if not self._times:
            return []
        times = np.array(self._times)
        return [
            Series(label, times, self._array(values, number.code), number.annotation, end).since(low)
            for (label, number), values in zip(self._numbers.items(), self._values, strict=True)
        ]

    @staticmethod
    def _array(values: array[Any], code: str) -> Any:
        return np.array(values, np.dtype(code))
