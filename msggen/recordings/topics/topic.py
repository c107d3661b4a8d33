"""A topic of a recording: its name, type and definition, its channels in the files, and its times."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from msggen.messages.names import stem_of
from msggen.recordings.columns.ordered import median
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from msggen.recordings.source.source import Channel

_NANOSECONDS = 1e9
_GAP = 5


@dataclass(frozen=True, eq=False)
class Topic:
    """A topic of a recording, or an instance of it."""

    name: str
    """The name in the recording: `/fmu/out/vehicle_status_v4`, or `vehicle_status` in a ULog.

    With `#1`, `#2` behind it if the definition changes, and so the topic is several topics."""
    instance: int
    """The number of the instance of a uORB topic, 0 for the first one and outside of ULogs."""
    ros_type: str
    """The type in ROS 2: `px4_msgs/msg/VehicleStatus`."""
    definition: str = field(repr=False)
    """The definition in the format `ros2msg`, "" if there is none."""
    type_hash: str
    """The type hash of ROS 2 (RIHS01), "" if the recording does not tell it."""
    channels: tuple[tuple[int, Channel], ...] = field(repr=False)
    """The channels that have its samples, each with the number of its file."""
    read_times: Callable[[], NDArray[np.int64]] | None = field(repr=False)
    """Returns the log times of all samples in ns. None for the topic of `Samples`, which does not keep the log."""
    read_ends: Callable[[], tuple[int, int] | None] | None = field(default=None, repr=False)
    """Returns the first and the last log time in ns, which is cheaper than all times. None to use those."""
    is_lent: bool = False
    """Whether `definition` is not in the recording, but taken from elsewhere: `Log.notes` tells from where."""
    firmware: str = ""
    """The version of the firmware that the recording tells: `v1.16.0`. Only a ULog does; otherwise ""."""

    @property
    def recorded_definition(self) -> str:
        """The definition that is in the recording, "" if there is none."""
        return "" if self.is_lent else self.definition

    @property
    def recorded_name(self) -> str:
        """The name in the files, which several topics have if the definition changes."""
        return self.channels[0][1].topic

    @cached_property
    def times(self) -> NDArray[np.int64]:
        """The log times of all samples in ns, in order. Reading them takes time in files without an index.

        Raises RecordingError for the topic of `Samples`.
        """
        if self.read_times is None:
            raise RecordingError(f"the topic of samples has no times: use log.topic({self.key!r})")
        return np.sort(self.read_times())

    @property
    def key(self) -> str | tuple[str, int]:
        """The key in a log: the name, or the name and the number of an instance that is not 0."""
        return (self.name, self.instance) if self.instance else self.name

    @cached_property
    def without_log(self) -> Topic:
        """The same topic without its log: it can be pickled, and a log that nothing else needs can be collected."""
        if self.read_times is None:
            return self
        own = object.__new__(Topic)  # `replace` takes several times as long
        own.__dict__.update(self.__dict__, read_times=None, read_ends=None)
        own.__dict__.pop("times", None)
        return own

    @cached_property
    def count(self) -> int:
        """How many samples there are, including samples that cannot be decoded."""
        return len(self.times) if self.known_count is None else self.known_count

    @property
    def known_count(self) -> int | None:
        """How many samples there are, None if the files do not tell."""
        counts = [channel.sample_count for _, channel in self.channels]
        known = [count for count in counts if count is not None]
        return sum(known) if len(known) == len(counts) else None

    @property
    def is_cdr(self) -> bool:
        """Whether the samples are CDR, as in ROS 2."""
        return all(channel.is_cdr for _, channel in self.channels)

    @cached_property
    def _ends(self) -> tuple[int, int]:
        """The log times of the first and the last sample in ns."""
        if self.read_ends is not None:
            return self.read_ends() or (0, 0)
        return (int(self.times[0]), int(self.times[-1])) if len(self.times) else (0, 0)

    @property
    def has_cdr(self) -> bool:
        """Whether the samples can be read as CDR: they are, or those of a ULog whose names ROS 2 allows."""
        return self.is_cdr or (bool(self.definition) and all(each.is_of_uorb for _, each in self.channels))

    @property
    def first(self) -> int:
        """The log time of the first sample in ns, 0 without samples."""
        return self._ends[0]

    @property
    def last(self) -> int:
        """The log time of the last sample in ns, 0 without samples."""
        return self._ends[1]

    @property
    def rate(self) -> float:
        """The mean rate in Hz, 0.0 for fewer than two samples."""
        return (self.count - 1) * _NANOSECONDS / (self.last - self.first) if self.last > self.first else 0.0

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """The times without samples, from ns to ns, that are longer than five times the median interval.

        Intervals of 0 do not count: samples can come in bursts.
        """
        intervals = np.diff(self.times)
        positive = intervals[intervals > 0]
        if not len(positive):
            return []
        before = np.flatnonzero(intervals > _GAP * median(positive))
        return [(int(self.times[index]), int(self.times[index + 1])) for index in before]

    @property
    def uorb(self) -> str:
        """The name of the topic in uORB: `vehicle_status`."""
        return stem_of(self.name).rpartition("/")[2]

    @property
    def label(self) -> str:
        """The name, with the instance if that is not 0: `sensor_gps 1`."""
        return f"{self.name} {self.instance}" if self.instance else self.name
