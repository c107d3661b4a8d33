"""Failsafes and what PX4's failure detector reports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.analysis.spans import common
from msggen.base.diagnostics import counted, few
from msggen.check.finding import Severity
from msggen.messages.vehicle_types import ROVER

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

MOST_FAILSAFES = 5
"""The failsafes that are findings of their own."""
_FLAGS, _WARNING = "failsafe_flags", "battery_warning"
_MOST_FLAGS = 200
"""The flags that are looked at: PX4 has some 30."""
_BEFORE, _AFTER, _NEAR = 10.0, 0.5, 1.0
"""The time in s before and after the begin of a failsafe in which its cause rises, and in which PX4 tells it."""
_LEVELS = "emergency", "alert", "critical", "error", "warning"
_STOPS = {
    "kill": "the kill switch stopped the motors",
    "manual_lockdown": "the kill switch stopped the motors",
    "force_failsafe": "the flight was terminated",
    "termination": "the flight was terminated",
}
"""What stops motors, by the fields of actuator_armed in v1.18 and before."""


def _failsafes(flight: Flight) -> Iterator[Seen]:
    every = [(each, _armed(flight, each)) for each in flight.timeline.failsafes]
    found = [(each, seconds) for each, seconds in every if seconds is not None]
    for (begin, end), seconds in found[:MOST_FAILSAFES]:
        mode, told = flight.timeline.mode_at(begin), _told(flight, begin)
        rose, is_set = _causes(flight, begin)
        text = f"failsafe for {seconds:.1f} s" + (f", in mode {mode}" if mode else "")
        text += f", because of {few(rose)}" if rose else f", with {few(is_set)} set" if is_set else ""
        text += f', with the text "{told}"' if told else ""
        values: dict[str, float | str] = {
            "duration_s": seconds,
            "mode": mode,
            "causes": ", ".join(rose or is_set),
            "message": told,
        }
        yield Seen(text, begin, end, values)
    if rest := found[MOST_FAILSAFES:]:
        seconds = sum(each for _, each in rest)
        text = f"{counted(len(rest), 'more failsafe')}, {seconds:.1f} s in all"
        yield Seen(text, rest[0][0][0], rest[-1][0][1], {"failsafes": len(rest), "duration_s": seconds})
    if disarmed := [each for each, armed in every if armed is None]:
        seconds = sum(end - begin for begin, end in disarmed)
        text = f"failsafe for {seconds:.1f} s while disarmed"
        yield Seen(text, disarmed[0][0], disarmed[-1][1], {"duration_s": seconds}, "info")


def _armed(flight: Flight, span: tuple[float, float]) -> float | None:
    """Return the time in s of a failsafe in which the vehicle was armed, None if it was not.

    It is 0 for one that begins with the last sample.
    """
    armed = flight.recorded.armed
    found = common((span,), armed)
    is_last = span[0] == span[1] and bool(armed) and span[0] <= armed[-1][1]
    return sum(end - begin for begin, end in found) if found or is_last else None


def _causes(flight: Flight, begin: float) -> tuple[list[str], list[str]]:
    """Return the flags of `failsafe_flags` that rose when a failsafe began, or before it.

    Of a failsafe that began before the recording, it is unknown which ones rose: the second list has those that are
    set.
    """
    names = [*flight.recorded.flags(_FLAGS)[:_MOST_FLAGS], _WARNING]
    columns = {name: column for name in names if (column := flight.recorded.column(_FLAGS, name))}
    after = {name: column.value_at(begin + _AFTER) for name, column in columns.items()}
    rose = [name for name, column in columns.items() if after[name] > column.value_at(begin - _BEFORE)]
    states = flight.recorded.column("vehicle_status", "failsafe")
    is_first = states is not None and begin <= states.times[0]
    return rose, [name for name, value in after.items() if value > 0] if is_first else []


def _told(flight: Flight, begin: float) -> str:
    """Return the text or event nearest to the begin of a failsafe, "" if there is none."""
    marks = (each for each in flight.timeline.marks if each.level in _LEVELS and abs(each.time - begin) <= _NEAR)
    found = min(marks, key=lambda each: abs(each.time - begin), default=None)
    return found.text.strip() if found else ""


def _killed(flight: Flight) -> Iterator[Seen]:
    for name, word in _STOPS.items():
        stretch = flight.above(flight.recorded.column("actuator_armed", name), 0.0)
        if stretch:
            is_flying = any(begin <= stretch.begin <= end for begin, end in flight.in_air)
            text = f"{word} {'in the air' if is_flying else 'on the ground'}"
            yield Seen(text, stretch.begin, stretch.end, {"cause": name}, "" if is_flying else "info")
    kind = flight.recorded.column("vehicle_status", "vehicle_type")
    touching = flight.touching
    for _, end in flight.recorded.armed if touching else ():
        was_flying = any(end == each for _, each in flight.in_air) and not (touching and touching.value_at(end))
        if end < flight.duration and was_flying and not (kind and kind.value_at(end) == ROVER):
            yield Seen("the vehicle was disarmed in the air", end)
            return


def _failures(flight: Flight) -> Iterator[Seen]:
    recorded, found = flight.recorded, {}
    for flag in recorded.flags("failure_detector_status")[:_MOST_FLAGS]:
        stretch = flight.above(recorded.column("failure_detector_status", flag), 0.0)
        if stretch is not None and stretch.seconds > 0:
            found[flag] = stretch
    if found:
        begin, end = min(each.begin for each in found.values()), max(each.end for each in found.values())
        values = {f"{flag}_s": each.seconds for flag, each in found.items()}
        yield Seen(f"the failure detector reports {few(list(found))}", begin, end, values)


RULES = (
    FlightRule(
        "IN_FAILSAFE",
        "PX4 was in failsafe",
        _failsafes,
        needs=(("vehicle_status.failsafe",),),
        uses=(_FLAGS,),
        fix="Look at the texts and events before it, which name the cause, and at the flags of `failsafe_flags`.",
        source="`failsafe` of vehicle_status; its cause is what rose in `failsafe_flags` from 10 s before on, or "
        "what is set if the recording begins in a failsafe. A note while disarmed",
        example="failsafe for 3.0 s, in mode Hold, because of manual_control_signal_lost",
    ),
    FlightRule(
        "FLIGHT_STOPPED",
        "the motors were stopped by the kill switch, by termination, or by disarming in the air",
        _killed,
        severity=Severity.ERROR,
        needs=(("actuator_armed.armed", "vehicle_status.arming_state"),),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected"),
        fix="If nobody wanted it, check the switch and its channel (RC_MAP_KILL_SW), and what may terminate a flight: "
        "CBRK_FLIGHTTERM, FD_EXT_ATS_EN, GF_ACTION. If the vehicle had landed, check its land detector.",
        source="the flags of actuator_armed; disarmed while vehicle_land_detected has no contact, except for rovers",
        example="the kill switch stopped the motors in the air",
    ),
    FlightRule(
        "FAILURE_DETECTED",
        "PX4's failure detector reported a failure in flight",
        _failures,
        severity=Severity.ERROR,
        needs=(("failure_detector_status",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Check motors, propellers and ESCs. FD_FAIL_R and FD_FAIL_P are the largest angles, and CBRK_FLIGHTTERM "
        "says whether PX4 ends the flight.",
        source="the flags of failure_detector_status",
        example="the failure detector reports fd_roll",
    ),
)
"""The rules."""
