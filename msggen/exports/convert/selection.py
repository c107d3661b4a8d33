"""What of a recording is written, the share of it that is done, and the result."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.source.source import FOREVER

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Key
    from msggen.recordings.source.source import Problem
    from msggen.recordings.topics.topic import Topic

_LONGEST = FOREVER / 1e9
"""The longest time in s."""


class Selection(NamedTuple):
    """What is written of recordings."""

    topics: Sequence[Key | Topic] | None
    """The topics, None for all."""
    start: float | None
    stop: float | None
    """From when to when, in s after the start."""
    fields: Collection[str] | None
    """The columns of tables, None for all."""

    def after(self, seconds: float) -> Selection:
        """Return the same for a recording whose first sample is so much later."""
        start, stop = (None if time is None else max(time - seconds, 0.0) for time in (self.start, self.stop))
        return self._replace(start=start, stop=stop)

    def limits(self, first: int) -> tuple[int, int]:
        """Return the log times in ns from when to when, for the log time of the first sample."""
        low, high = (min(first + round(min(time or 0.0, _LONGEST) * 1e9), FOREVER) for time in (self.start, self.stop))
        return 0 if self.start is None else low, FOREVER if self.stop is None else high


EVERYTHING = Selection(None, None, None, None)


class Converted(NamedTuple):
    """The result of a conversion."""

    files: Sequence[str]
    """The paths of the files."""
    rows: int
    """How many samples were written, without the rows of tables of what a ULog has beside its topics."""
    problems: Sequence[Problem]
    """What the recording has and what is not in the files."""
    notes: Sequence[str] = ()
    """Where definitions are from that are not in the recording, and why events are not decoded."""
    size: int = 0
    """The bytes of the files."""


class Share:
    """The share of the chosen time from `first` to `last`, log times in ns, that was reached. It does not go back."""

    def __init__(self, first: int, last: int, selection: Selection, progress: Callable[[float], None]) -> None:
        low, high = selection.limits(first)
        self._first = max(low, first)
        self._duration = max(min(high, last) - self._first, 1)
        self._progress = progress
        self._reached = 0.0

    def reach(self, log_times: NDArray[np.int64]) -> None:
        """Tell the share at the last of some log times in ns."""
        share = (int(log_times[-1]) - self._first) / self._duration
        if self._reached < share <= 1:
            self._reached = share
            self._progress(share)

    def end(self) -> None:
        """Tell that everything is done."""
        self._progress(1.0)
