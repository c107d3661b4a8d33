"""The receiver of the GPS and of other satellites."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen
from msggen.check.finding import Category, Severity
from msggen.messages.gps import HAS_FIX

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column

_TOPICS = "sensor_gps", "vehicle_gps_position"
_GPS = tuple(f"{topic}.fix_type" for topic in _TOPICS)


def _column(flight: Flight, field: str) -> Column | None:
    """Return a field of the first topic of a receiver that the recording has."""
    found = (flight.recorded.column(topic, field) for topic in _TOPICS if topic in flight.recorded)
    return next(filter(None, found), None)


def _lost(flight: Flight) -> Iterator[Seen]:
    fix = _column(flight, "fix_type")
    later = fix.since_above(HAS_FIX - 1) if fix else None  # a vehicle indoors never has one
    stretch = flight.below(later, HAS_FIX)
    if stretch and stretch.seconds > 0:
        text = f"the GPS had no fix for {stretch.seconds:.1f} s"
        yield Seen(text, stretch.begin, stretch.end, {"lost_s": stretch.seconds})


def _jammed(flight: Flight) -> Iterator[Seen]:
    stretch = flight.above(_column(flight, "jamming_state"), 1.0)
    if stretch and stretch.seconds > 0:
        text = f"the GPS reports jamming for {stretch.seconds:.1f} s"
        yield Seen(text, stretch.begin, stretch.end, {"jammed_s": stretch.seconds})


RULES = (
    FlightRule(
        "GPS_FIX_LOST",
        "the GPS lost its fix in flight",
        Category.FLIGHT,
        _lost,
        severity=Severity.WARNING,
        needs=(_GPS,),
        uses=("vehicle_status", "actuator_armed"),
        fix="Give the antenna a free view of the sky, away from cameras, radios and USB cables.",
        source="`fix_type` below 3 after a fix",
        example="the GPS had no fix for 2.0 s",
    ),
    FlightRule(
        "GPS_JAMMED",
        "the GPS reports jamming",
        Category.FLIGHT,
        _jammed,
        severity=Severity.WARNING,
        needs=(tuple(f"{topic}.jamming_state" for topic in _TOPICS),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Look for a source on the vehicle, such as a transmitter of video, USB 3 or a switching regulator. If it "
        "is elsewhere, fly without GPS there, or not at all.",
        source="`jamming_state` of sensor_gps: 2 is mitigated, 3 detected",
        example="the GPS reports jamming for 4.9 s",
    ),
)
"""The rules."""
