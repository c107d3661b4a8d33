"""What happened when: flight modes, failsafes and events."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import NamedTuple

from msggen.analysis.recorded import Recorded, spans
from msggen.base.diagnostics import printable
from msggen.messages.nav_states import EXTERNAL, MODE_TITLES, mode_number, mode_title
from msggen.recordings.log.series import MODES

_REPLY = "register_ext_component_reply"
"""The topic in which PX4 tells which mode it gave to a program."""
TOPICS = frozenset({MODES[0], _REPLY})
"""The topics that flight modes and failsafes are from."""
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
    own = _registered(recorded)
    found = sorted(
        (begin, min(end, recorded.duration), _own_name(band.name, own, end) or mode_title(band.name))
        for band in modes.bands
        for begin, end in band.spans
    )
    colours: dict[str, int] = {}
    for _, _, name in found:
        colours.setdefault(name, len(colours) % COLOURS)
    return [Stretch(name, colours[name], begin, end) for begin, end, name in found if end > begin]


def _registered(recorded: Recorded) -> dict[int, list[tuple[float, str]]]:
    """Return when programs registered modes, in s, and the names that they gave them, by the numbers of the modes."""
    samples = recorded.samples(_REPLY)
    if samples is None or not {"success", "mode_id", "name"} <= {*(samples.array.dtype.names or ())}:
        return {}
    found: dict[int, list[tuple[float, str]]] = {}
    for time, row in zip(samples.log_times, samples.array, strict=True):
        name = printable(bytes(row["name"]).partition(b"\0")[0].decode(errors="replace").strip())
        if row["success"] and row["mode_id"] in EXTERNAL and name:
            found.setdefault(int(row["mode_id"]), []).append(((time - recorded.log.start) / 1e9, name))
    return found


def _own_name(name: str, registered: Mapping[int, Sequence[tuple[float, str]]], end: float) -> str:
    """Return the name that a program gave the mode that ended at a time, "" if the recording does not tell it.

    PX4 gives the same mode to other programs later. A name that PX4 uses itself is followed by that of the mode.
    """
    of_mode = registered.get(mode_number(name) or 0, ())
    place = bisect_right(of_mode, end, key=itemgetter(0))
    own = of_mode[place - 1][1] if place else ""
    return f"{own} ({mode_title(name)})" if own in MODE_TITLES.values() else own


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
