"""What happened when: flight modes, failsafes and events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from msggen.analysis.recorded import Recorded, spans
from msggen.messages.nav_states import MODE_CONSTANTS, MODE_TITLES
from msggen.recordings.log.series import MODES

_NAMES = {constant: MODE_TITLES[mode] for mode, constant in MODE_CONSTANTS.items()}
"""The names of modes in ground stations, by those in PX4."""
COLOURS = 10
"""The number of colours of modes."""


class Stretch(NamedTuple):
    """A time in which a mode was flown, in s."""

    name: str
    colour: int
    begin: float
    end: float


class Mark(NamedTuple):
    """A text of the vehicle's log, or an event."""

    time: float
    level: str
    text: str
    description: str = ""
    is_event: bool = False


class Timeline(NamedTuple):
    """What happened in a recording."""

    modes: Sequence[Stretch]
    """In the order of time."""
    failsafes: Sequence[tuple[float, float]]
    marks: Sequence[Mark]

    @property
    def colours(self) -> dict[str, int]:
        """The modes and their colours, in the order in which they were flown."""
        return {each.name: each.colour for each in self.modes}

    def mode_at(self, time: float) -> str:
        """Return the mode at a time, "" if it is not known."""
        return next((each.name for each in self.modes if each.begin <= time < each.end), "")


def timeline_of(recorded: Recorded) -> Timeline:
    """Return what happened in a recording."""
    failsafe = recorded.column("vehicle_status", "failsafe")
    failsafes = () if failsafe is None else spans(failsafe, failsafe.values > 0, recorded.duration)
    return Timeline(_modes(recorded), failsafes, _marks(recorded))


def _modes(recorded: Recorded) -> list[Stretch]:
    modes = recorded.series(*MODES)
    if modes is None or not modes.is_named:
        return []
    found = sorted(
        (begin, min(end, recorded.duration), _name(band.name)) for band in modes.bands for begin, end in band.spans
    )
    colours: dict[str, int] = {}
    for _, _, name in found:
        colours.setdefault(name, len(colours) % COLOURS)
    return [Stretch(name, colours[name], begin, end) for begin, end, name in found if end > begin]


def _name(name: str) -> str:
    """Return the name of a mode as ground stations show it."""
    if name.isdecimal():
        return f"Mode {name}"
    front = name.rstrip("0123456789")
    number = name[len(front) :]
    return _NAMES.get(name) or " ".join(filter(None, [front.replace("_", " ").capitalize(), number]))


def _marks(recorded: Recorded) -> list[Mark]:
    """Return the texts and events that users read, in the order of time."""
    log, start = recorded.log, recorded.log.start
    descriptions = {(each.time, each.text): each.description for each in log.events}
    return [
        Mark(
            (text.time - start) / 1e9,
            text.level,
            text.text,
            descriptions.get((text.time, text.text), ""),
            text.is_event,
        )
        for text in log.texts
    ]
