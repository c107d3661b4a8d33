"""The rates of topics over the last seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import pairwise

from msggen.show.top.rows import Row

SECONDS = 20
"""The seconds that are kept."""
_SECOND = 1_000_000_000
_BLOCKS = "▁▂▃▄▅▆▇"
"""The heights of a rate. A full block would touch the line above."""


class _Counts:
    """The samples of a topic: all at a time in ns, and those until each of the last whole seconds."""

    def __init__(self, time: int, samples: int) -> None:
        self._time, self._samples = time, samples
        self._whole: deque[float] = deque(maxlen=SECONDS + 1)

    def add(self, time: int, samples: int) -> None:
        """Note the samples until a time. Between two times, they are taken to be evenly spaced."""
        first, last = self._time // _SECOND + 1, time // _SECOND
        for second in range(max(first, last - SECONDS), last + 1):
            share = (second * _SECOND - self._time) / (time - self._time)
            self._whole.append(self._samples + share * (samples - self._samples))
        self._time, self._samples = time, samples

    @property
    def rates(self) -> tuple[float, ...]:
        """The samples in each whole second, the oldest first."""
        return tuple(later - earlier for earlier, later in pairwise(self._whole))


class History:
    """Notes how many samples each topic has, and tells how many each second had."""

    def __init__(self) -> None:
        self._topics: dict[str, _Counts] = {}

    def add(self, rows: Iterable[Row], now: int) -> tuple[Row, ...]:
        """Note the samples of rows until `now`, of `time.time_ns`. Return the rows with their rates."""
        return tuple(self._noted(row, now) for row in rows)

    def _noted(self, row: Row, now: int) -> Row:
        counts = self._topics.setdefault(row.topic, _Counts(now, row.samples))
        counts.add(now, row.samples)
        return row._replace(rates=counts.rates)


def sparkline(rates: Sequence[float]) -> str:
    """Return rates as blocks, the highest for the largest rate. "" without a sample."""
    largest = max(rates, default=0.0)
    if largest <= 0:
        return ""
    return "".join(_BLOCKS[round(max(0.0, rate) / largest * (len(_BLOCKS) - 1))] for rate in rates)
