"""Failsafes and what PX4's failure detector reports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.base.diagnostics import counted, few
from msggen.check.finding import Category, Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight

MOST_FAILSAFES = 5
"""The failsafes that are findings of their own."""


def _failsafes(flight: Flight) -> Iterator[Seen]:
    found = flight.timeline.failsafes
    for begin, end in found[:MOST_FAILSAFES]:
        mode = flight.timeline.mode_at(begin)
        text = f"failsafe for {end - begin:.1f} s" + (f", in mode {mode}" if mode else "")
        yield Seen(text, begin, end, {"duration_s": end - begin})
    if rest := found[MOST_FAILSAFES:]:
        seconds = sum(end - begin for begin, end in rest)
        text = f"{counted(len(rest), 'more failsafe')}, {seconds:.1f} s in all"
        yield Seen(text, rest[0][0], rest[-1][1], {"failsafes": len(rest), "duration_s": seconds})


def _failures(flight: Flight) -> Iterator[Seen]:
    recorded, found = flight.recorded, {}
    for flag in recorded.flags("failure_detector_status"):
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
        Category.FLIGHT,
        _failsafes,
        severity=Severity.WARNING,
        needs=(("vehicle_status.failsafe",),),
        fix="Look at the texts and events before it, which name the cause, and at the flags of `failsafe_flags`.",
        source="`failsafe` of vehicle_status",
        example="failsafe for 3.0 s, in mode Hold",
    ),
    FlightRule(
        "FAILURE_DETECTED",
        "PX4's failure detector reported a failure in flight",
        Category.FLIGHT,
        _failures,
        needs=(("failure_detector_status",),),
        fix="Check motors, propellers and ESCs. FD_FAIL_R and FD_FAIL_P are the largest angles, and CBRK_FLIGHTTERM "
        "says whether PX4 ends the flight.",
        source="the flags of failure_detector_status",
        example="the failure detector reports fd_roll",
    ),
)
"""The rules."""
