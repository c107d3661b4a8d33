"""A flight as the rules see it: the samples of one vehicle, and what happened when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.figures import Track, track_of
from msggen.analysis.recorded import Column, Recorded, spans
from msggen.analysis.timeline import TOPICS, Timeline, timeline_of

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log


class Stretch(NamedTuple):
    """The times in which a value was beyond a limit while armed, in s."""

    seconds: float
    """All of them."""
    begin: float
    """Of the first one."""
    end: float
    """Of the last one."""


@dataclass(frozen=True)
class Flight:
    """A recording of one vehicle. What several rules need is computed once."""

    recorded: Recorded

    @property
    def log(self) -> Log:
        """The recording."""
        return self.recorded.log

    @property
    def duration(self) -> float:
        """The time from the first to the last sample, in s."""
        return self.recorded.duration

    @cached_property
    def timeline(self) -> Timeline:
        """The flight modes, failsafes, texts and events."""
        return timeline_of(self.recorded)

    @cached_property
    def track(self) -> Track | None:
        """The track over ground, None if the recording has no positions."""
        return track_of(self.recorded)

    @cached_property
    def seconds_armed(self) -> float:
        """The time in which the vehicle was armed, in s."""
        return sum(end - begin for begin, end in self.recorded.armed)

    def above(self, column: Column | None, limit: float, *, armed: bool = True) -> Stretch | None:
        """Return when a value is above a limit, each time until the next sample; None if it never is."""
        if column is None or not len(column.times):
            return None
        mask = column.values > limit
        if armed:
            mask &= column.is_within(self.recorded.armed)
        found = spans(column, mask, float(column.times[-1]))
        return Stretch(sum(end - begin for begin, end in found), found[0][0], found[-1][1]) if found else None

    def below(self, column: Column | None, limit: float, *, armed: bool = True) -> Stretch | None:
        """Return when a value is below a limit, as `above` does."""
        return None if column is None else self.above(column._replace(values=-column.values), -limit, armed=armed)

    def changes(self, column: Column | None) -> list[float]:
        """Return the times at which a counter changed while armed, in s."""
        if column is None:
            return []
        mask = (np.diff(column.values) != 0) & column.is_within(self.recorded.armed)[1:]
        return [float(time) for time in column.times[1:][mask]]


def flight_of(log: Log, is_needed: Callable[[str], bool]) -> Flight:
    """Return the flight in a recording, with its modes, and the topics whose names in uORB `is_needed` takes."""
    return Flight(Recorded(log, lambda name: name in TOPICS or is_needed(name)))
