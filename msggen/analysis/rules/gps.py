"""The receiver of the GPS and of other satellites."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid
from msggen.base.diagnostics import counted
from msggen.check.finding import Severity
from msggen.messages.earth import HAS_FIX, RADIUS

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column

_TOPICS = "sensor_gps", "vehicle_gps_position"
_POSITIONS = (("latitude_deg", "longitude_deg", 1.0), ("lat", "lon", 1e-7))
"""The names of latitude and longitude, and their scale in degrees."""
_JUMP, _ACCURACIES, _LONGEST = 5.0, 3.0, 2.0
"""How far a position may jump, in m and in times of its accuracy, and the longest time in s between two positions."""


def _fields(name: str) -> tuple[str, ...]:
    """Return the paths of a field, in the order in which they are looked at."""
    return tuple(f"{topic}.{name}" for topic in _TOPICS)


def _receivers(flight: Flight) -> Iterator[tuple[str, str, int]]:
    """Yield the name, the topic and the instance of each receiver."""
    topic = next(filter(flight.recorded.__contains__, _TOPICS), "")
    for instance in flight.recorded.instances(topic):
        yield f"GPS {instance}" if instance else "GPS", topic, instance


def _lost(flight: Flight) -> Iterator[Seen | Unsaid]:
    for name, topic, instance in _receivers(flight):
        fix = flight.recorded.column(topic, "fix_type", instance)
        later = fix.since_above(HAS_FIX - 1) if fix else None
        if later and not len(later.times):
            yield Unsaid(f"the {name} never had a fix, as indoors")
        stretch = flight.below(later, HAS_FIX)
        if stretch and stretch.seconds > 0:
            text = f"the {name} had no fix for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, {"receiver": instance, "lost_s": stretch.seconds})
        silences = flight.silences(later) if later else ()
        if silences:
            seconds = sum(end - begin for begin, end in silences)
            text = f"the {name} sent nothing for {seconds:.1f} s"
            yield Seen(text, silences[0][0], silences[-1][1], {"receiver": instance, "silent_s": seconds})


def _reported(field: str, word: str, flight: Flight) -> Iterator[Seen]:
    for name, topic, instance in _receivers(flight):
        stretch = flight.above(flight.recorded.column(topic, field, instance), 1.0)
        if stretch and stretch.seconds > 0:
            text = f"the {name} reports {word} for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, {"receiver": instance, "reported_s": stretch.seconds})


def _ways(flight: Flight, topic: str, instance: int) -> Column | None:
    """Return how many m each position is away from the one before, less the way at the speed that is told.

    NaN where there is no fix, and for positions that are far apart in time. None without positions.
    """
    import numpy as np

    for latitude_name, longitude_name, scale in _POSITIONS:
        latitude, longitude, fix, speed = (
            flight.recorded.column(topic, name, instance)
            for name in (latitude_name, longitude_name, "fix_type", "vel_m_s")
        )
        if latitude is None or longitude is None:
            continue
        latitude = latitude.where(fix._replace(values=fix.values - (HAS_FIX - 1)) if fix else None)
        north, east = (np.radians(each.values * scale) for each in (latitude, longitude))
        turn = (np.diff(east) + np.pi) % (2 * np.pi) - np.pi  # across the date line, too
        ways = RADIUS * np.hypot(np.diff(north), turn * np.cos(north[:-1]))
        steps = np.diff(latitude.times)
        told = np.nan_to_num(speed.at(latitude.times)) if speed is not None else np.zeros(len(latitude.times))
        rest = np.where(steps <= _LONGEST, ways - np.maximum(told[1:], told[:-1]) * steps, np.nan)
        return latitude._replace(values=np.concatenate(([np.nan], rest)), is_held=False)
    return None


def _jumped(flight: Flight) -> Iterator[Seen]:
    import numpy as np

    least = max(flight.parameter("COM_POS_FS_EPH", _JUMP), _JUMP)
    for name, topic, instance in _receivers(flight):
        found = _ways(flight, topic, instance)
        if not found:
            continue
        accuracy = flight.recorded.column(topic, "eph", instance)
        here = accuracy.at(found.times) if accuracy else np.full(len(found.times), np.nan)
        limits = np.fmax(_ACCURACIES * np.fmax(here, np.append(np.nan, here[:-1])), least)
        jumps = (found.values > limits) & np.isfinite(found.values) & found.is_within(flight.recorded.armed)
        if jumps.any():
            times, sizes = found.times[jumps], found.values[jumps]
            worst, limit = float(sizes.max()), float(limits[jumps][sizes.argmax()])
            values = {"receiver": instance, "jumps": len(sizes), "jump_m": worst, "limit_m": limit}
            text = f"the position of the {name} jumped {counted(len(sizes), 'time')}, by up to {worst:.0f} m"
            yield Seen(text, float(times[0]), float(times[-1]), values)


RULES = (
    FlightRule(
        "GPS_FIX_LOST",
        "the GPS lost its fix in flight, or sent nothing",
        _lost,
        needs=(_fields("fix_type"),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Give the antenna a free view of the sky, away from cameras, radios and USB cables.",
        source="`fix_type` below 3 after a fix, or no sample for 2 s while vehicle_status goes on",
        example="the GPS had no fix for 2.0 s",
    ),
    FlightRule(
        "GPS_JAMMED",
        "the GPS reports jamming",
        partial(_reported, "jamming_state", "jamming"),
        needs=(_fields("jamming_state"),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Look for a source on the vehicle, such as a transmitter of video, USB 3 or a switching regulator. If it "
        "is elsewhere, fly without GPS there, or not at all.",
        source="`jamming_state` of sensor_gps: 2 is mitigated, 3 detected",
        example="the GPS reports jamming for 4.9 s",
    ),
    FlightRule(
        "GPS_SPOOFED",
        "the GPS reports that its signals are not those of satellites",
        partial(_reported, "spoofing_state", "spoofing"),
        severity=Severity.ERROR,
        needs=(_fields("spoofing_state"),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Do not trust the position. Fly without GPS there, or not at all.",
        source="`spoofing_state` of sensor_gps: 2 is mitigated, 3 detected",
        example="the GPS reports spoofing for 3.0 s",
    ),
    FlightRule(
        "GPS_JUMPED",
        "the position of the GPS jumped farther than its speed explains",
        _jumped,
        needs=(tuple(path for name, *_ in _POSITIONS for path in _fields(name)),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Give the antenna a free view of the sky, look for sources of jamming, and do not fly close to buildings.",
        source="COM_POS_FS_EPH, 5 m at least, and 3 times the accuracy that the receiver tells at both positions",
        example="the position of the GPS jumped 2 times, by up to 48 m",
    ),
)
"""The rules."""
