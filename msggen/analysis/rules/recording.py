"""What the recording itself tells: damage, dropouts, its end, texts and parameters."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid
from msggen.base.diagnostics import counted, few
from msggen.base.recording_formats import FORMATS
from msggen.check.finding import Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

_HEIGHT = 1.0
"""The height in m from which a vehicle is in the air: the estimate of a vehicle that stands drifts by less."""
_CURRENT = 2.0
"""The age in s up to which an estimate is that of the end."""
_MISSING = 0.1
"""The time in s in all from which dropouts matter: single ones of some 30 ms are normal for SD cards."""
_SEVERE = ("emergency", "alert", "critical", "error")


def _damage(flight: Flight) -> Iterator[Seen]:
    if problems := flight.log.problems:
        yield Seen(f"the recording is damaged: {counted(len(problems), 'problem')}", values={"problems": len(problems)})


def _hard_fault(flight: Flight) -> Iterator[Seen]:
    if "hardfault_plain" in flight.log.information:
        yield Seen("the firmware crashed before this log: it has the text of a hard fault")


def _dropouts(flight: Flight) -> Iterator[Seen]:
    log = flight.log
    if not log.dropouts:
        return
    seconds = [each.duration / 1e9 for each in log.dropouts]
    lost = f"{sum(seconds):.2f} s are missing, at most {max(seconds):.2f} s at a time"
    begin, last = ((each.time - log.start) / 1e9 for each in (log.dropouts[0], log.dropouts[-1]))
    values = {"dropouts": len(seconds), "missing_s": sum(seconds), "longest_s": max(seconds), "limit_s": _MISSING}
    level = "" if sum(each.duration for each in log.dropouts) >= _MISSING * 1e9 else "info"
    yield Seen(f"{counted(len(seconds), 'dropout')} of the logger: {lost}", begin, last + seconds[-1], values, level)


def _jumps(flight: Flight) -> Iterator[Seen | Unsaid]:
    from msggen.analysis.flight import BACK, GAP, jumps_of
    from msggen.recordings.source.source import RecordingError

    try:
        back, silent = jumps_of(flight.log)
    except RecordingError as error:  # as of a log that is closed
        yield Unsaid(f"the times cannot be read: {error}")
        return
    if back:
        longest = max(before - after for before, after in back)
        text = f"the log times step back {counted(len(back), 'time')}, by up to {longest:.1f} s"
        values = {"steps": len(back), "longest_s": longest, "limit_s": BACK}
        yield Seen(text, back[0][1], max(before for before, _ in back), values)
    if silent:
        longest = max(after - before for before, after in silent)
        text = f"no topic has a sample for up to {longest:.1f} s, {counted(len(silent), 'time')}"
        values = {"gaps": len(silent), "longest_s": longest, "limit_s": GAP}
        yield Seen(text, silent[0][0], silent[-1][1], values)


def _end(flight: Flight) -> Iterator[Seen]:
    recorded = flight.recorded
    states = [recorded.column("vehicle_land_detected", name) for name in ("landed", "maybe_landed", "ground_contact")]
    is_grounded = any(each is not None and each.values[-1] for each in states)  # a rover always has ground contact
    if is_grounded or not recorded.armed or recorded.armed[-1][1] < recorded.duration:
        return
    is_vehicles = FORMATS[recorded.log.kind].is_of_vehicle  # other recorders are ended at any time
    level = "warning" if is_vehicles else "info"
    height = _height(flight)
    if height is None:
        yield Seen("the recording ends in the air", recorded.duration, level=level)
        return
    where = "in the air" if height >= _HEIGHT else "before the vehicle has disarmed"
    text = f"the recording ends {where}, {height:.1f} m above where it armed"
    yield Seen(text, recorded.duration, values={"height_m": height, "limit_m": _HEIGHT}, level=level)


def _height(flight: Flight) -> float | None:
    """Return the height in m above where the vehicle armed at the end, None if it is not known then."""
    recorded = flight.recorded
    down = recorded.column("vehicle_local_position", "z")
    down = down and down.where(recorded.column("vehicle_local_position", "z_valid")).within(recorded.armed[-1:])
    if down is None or not len(down.times) or down.times[-1] < recorded.duration - _CURRENT:
        return None
    return -down.growth if isfinite(down.values[-1]) else None


def _texts(levels: tuple[str, ...], flight: Flight) -> Iterator[Seen]:
    found = [mark for mark in flight.timeline.marks if mark.level in levels]
    if found:
        texts = few(list(dict.fromkeys(mark.text.strip() for mark in found)))
        text = f"{counted(len(found), levels[-1])} in the vehicle's log: {texts}"
        yield Seen(text, found[0].time, found[-1].time, {"texts": len(found)})


def _parameters(flight: Flight) -> Iterator[Seen]:
    changed = flight.log.facts.changed_parameters
    if changed:
        names = few(list(dict.fromkeys(name for _, name, _ in changed)))
        begin, end = ((each[0] - flight.log.start) / 1e9 for each in (changed[0], changed[-1]))
        yield Seen(f"parameters changed during the log: {names}", begin, end, {"changes": len(changed)}, "info")


RULES = (
    FlightRule(
        "LOG_DAMAGED",
        "parts of the recording cannot be read",
        _damage,
        severity=Severity.ERROR,
        fix="Read the list of problems: `msggen log info`. What can be read is told; what is missing may have been "
        "worse. Write the readable part with `msggen log mcap repair` or `msggen log convert`.",
        example="the recording is damaged: 1 problem",
    ),
    FlightRule(
        "HARD_FAULT",
        "the firmware crashed before the recording began",
        _hard_fault,
        severity=Severity.ERROR,
        fix="Do not fly before the cause is known. `log.information['hardfault_plain']` has the text: PX4's "
        "developers need it, with the firmware's ELF file.",
        example="the firmware crashed before this log: it has the text of a hard fault",
    ),
    FlightRule(
        "LOG_DROPOUTS",
        "the logger lost samples, because the storage was too slow",
        _dropouts,
        fix="Use a faster SD card, format it, or log fewer topics, which SDLOG_PROFILE selects.",
        source="the dropouts that PX4's logger writes into the log. A note below 0.1 s in all",
        example="2 dropouts of the logger: 0.30 s are missing, at most 0.20 s at a time",
    ),
    FlightRule(
        "LOG_TIME_JUMPS",
        "the log times step back, or no topic has a sample for long",
        _jumps,
        fix="Do not trust durations, rates and gaps of this recording. If a computer recorded it, set its clock "
        "before, and not meanwhile; or the recorder or the link stood still.",
        source="steps back of 1 s or more of the topic with the most samples; more than 10 s without a sample of any "
        "topic, and 10 times as long as that topic usually takes",
        example="the log times step back 1 time, by up to 5.0 s",
    ),
    FlightRule(
        "LOG_ENDS_IN_AIR",
        "the recording ends while the vehicle is armed and has not landed",
        _end,
        needs=(("vehicle_land_detected.landed",), ("vehicle_status.arming_state", "actuator_armed.armed")),
        uses=("vehicle_local_position",),
        fix="If the vehicle crashed, the last seconds tell why, and the power may have failed. If not, the storage "
        "was full or was removed, or SDLOG_MODE ends the log in flight.",
        example="the recording ends in the air, 12.3 m above where it armed",
    ),
    FlightRule(
        "ERRORS_LOGGED",
        "the vehicle logged texts or events from `error` on",
        partial(_texts, _SEVERE),
        severity=Severity.ERROR,
        fix="Read the texts and events in their order: `msggen log show`, or the table in the report.",
        example="2 errors in the vehicle's log: Failsafe activated and Motor failure",
    ),
    FlightRule(
        "WARNINGS_LOGGED",
        "the vehicle logged texts or events of the level `warning`",
        partial(_texts, ("warning",)),
        fix="Read the texts and events in their order: `msggen log show`, or the table in the report.",
        example="1 warning in the vehicle's log: Low battery",
    ),
    FlightRule(
        "PARAMETERS_CHANGED",
        "parameters changed during the recording",
        _parameters,
        fix="Compare the flight before and after the change apart.",
        example="parameters changed during the log: MPC_XY_CRUISE",
    ),
)
"""The rules."""
