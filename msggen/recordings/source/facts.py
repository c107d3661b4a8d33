"""What a recording tells beside its topics: parameters, information, texts, events and dropouts."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

LEVELS = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
"""The levels of texts, as in Linux (https://docs.px4.io/main/en/dev_log/ulog_file_format.html)."""


class Text(NamedTuple):
    """A line of a vehicle's log."""

    time: int
    """In ns, as log times are."""
    level: str
    """`emergency`, `alert`, `critical`, `error`, `warning`, `notice`, `info`, `debug`, or `unknown`."""
    text: str
    tag: int | None = None
    is_event: bool = False
    """Whether it is an event, or a line that the vehicle also sent as one."""


class Event(NamedTuple):
    """An event of PX4: what happened, in words. Without metadata, it has no name, group, description and arguments."""

    time: int
    """In ns, as log times are."""
    number: int
    """The number of its definition in the metadata (`id` in Event.msg)."""
    sequence: int
    """The number of the event: the vehicle counts up, so that a gap is a lost event."""
    level: str
    """The level in the vehicle's log: as that of a text, or `protocol` or `disabled`, which are not for users."""
    external_level: str
    """The level for ground stations and other programs."""
    text: str
    """What it says, `event 0x0112abcd` without metadata."""
    name: str = ""
    """The name in the metadata: `commander_armed_by`."""
    group: str = ""
    """`default` for what a user reads, `arming_check`, `health`, `calibration`."""
    description: str = ""
    """More about it, such as what to do."""
    arguments: Mapping[str, int | float] = MappingProxyType({})

    @property
    def is_text(self) -> bool:
        """Whether it is among the texts of the log: those of other groups are reports for ground stations."""
        return self.level in LEVELS and self.group in ("", "default")


class Dropout(NamedTuple):
    """A period in which the logger lost samples."""

    time: int
    """The time in ns of the last sample before it, 0 if there is none."""
    duration: int
    """In ns."""


def is_same(value: object, other: object) -> bool:
    """Whether two values, as those of a parameter, are the same. NaN is the same as NaN."""
    return value == other or (value != value and other != other)  # noqa: PLR0124 - true for NaN alone


class Facts(NamedTuple):
    """What only a ULog has beside its topics, and an MCAP file that was made of one."""

    parameters: Mapping[str, int | float]
    """The parameters at the start of the log."""
    changed_parameters: Sequence[tuple[int, str, int | float]]
    """Times in ns, names and values of parameters that changed later."""
    default_parameters: Mapping[str, int | float]
    """The defaults of the firmware that differ from the parameters at the start."""
    information: Mapping[str, object]
    """Such as `sys_name`, `ver_sw`: text, numbers, tuples, bytes; what has several parts is a list of lists of them."""
    texts: Sequence[Text]
    dropouts: Sequence[Dropout]
    start: int | None = None
    """The log time in ns at which the recording starts: some samples are older. None if it does not tell."""
    boot: int | None = None
    """When the vehicle started, in ns since 1970, if that was added to the times in the ULog."""
    airframe_defaults: Mapping[str, int | float] = MappingProxyType({})
    """The defaults of the airframe that differ from the parameters at the start."""

    @property
    def has_defaults(self) -> bool:
        """Whether the log has defaults. Older firmware does not write them."""
        return bool(self.default_parameters or self.airframe_defaults)

    @property
    def tuned(self) -> Mapping[str, int | float]:
        """The defaults of the airframe, of the parameters that had other values at the start."""
        return self._others(self.airframe_defaults)

    @property
    def configured(self) -> Mapping[str, int | float]:
        """The defaults of the firmware, of the parameters that had other values at the start."""
        return self._others(self.default_parameters)

    def _others(self, defaults: Mapping[str, int | float]) -> Mapping[str, int | float]:
        own = self.parameters
        return {name: value for name, value in defaults.items() if name in own and not is_same(own[name], value)}


NO_FACTS = Facts({}, (), {}, {}, (), ())
