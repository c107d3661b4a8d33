"""What a flight was: the vehicle and its firmware; in numbers how long, how far, how high, how fast; and its track."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.recorded import Column, Recorded, tilt_of
from msggen.base.diagnostics import counted
from msggen.base.recording_formats import FORMATS
from msggen.messages.earth import HAS_FIX, RADIUS
from msggen.recordings.columns.annotations import annotation_of
from msggen.recordings.log.origin import time_of_day

if TYPE_CHECKING:
    from numpy.typing import NDArray

_QUARTER = 90
"""The degrees from the equator to a pole."""
_FARTHEST = 2e7
"""Half of the way around the earth in m. A position that is farther away, or no number, is none."""
_STEP = 1.0
"""The time in s between the positions whose distances are summed: noise would add to shorter ones."""


class Track(NamedTuple):
    """Where a vehicle was: a plane, in m."""

    times: NDArray[np.float64]
    east: NDArray[np.float64]
    north: NDArray[np.float64]
    up: NDArray[np.float64]
    """Above the first height that is known; NaN where it is not known."""
    source: str
    """The topic."""


class Figure(NamedTuple):
    """A number about a flight, or what is known of its vehicle or its file."""

    name: str
    value: str
    note: str = ""


def track_of(recorded: Recorded) -> Track | None:
    """Return the track, None if the recording does not have positions."""
    planes = (
        ("vehicle_local_position", ("x", "y", "z"), ("xy_valid", "z_valid")),
        ("vehicle_odometry", ("position[0]", "position[1]", "position[2]"), ("", "")),
    )
    globes = (
        ("vehicle_global_position", ("lat", "lon", "alt"), (1.0, 1.0)),
        ("sensor_gps", ("latitude_deg", "longitude_deg", "altitude_msl_m"), (1.0, 1.0)),
        ("vehicle_gps_position", ("latitude_deg", "longitude_deg", "altitude_msl_m"), (1.0, 1.0)),
        ("sensor_gps", ("lat", "lon", "alt"), (1e-7, 1e-3)),
        ("vehicle_gps_position", ("lat", "lon", "alt"), (1e-7, 1e-3)),
    )
    found = chain((_plane(recorded, *each) for each in planes), (_globe(recorded, *each) for each in globes))
    return next(filter(None, found), None)


def _plane(recorded: Recorded, topic: str, fields: tuple[str, str, str], valid: tuple[str, str]) -> Track | None:
    x, y, z = (recorded.column(topic, field) for field in fields)
    if x is None or y is None:
        return None
    x = x.where(recorded.column(topic, valid[0]))
    mask = (np.abs(x.values) < _FARTHEST) & (np.abs(y.values) < _FARTHEST)
    if not mask.any():
        return None
    up = _up(z and z.where(recorded.column(topic, valid[1])), mask, -1.0)
    return Track(x.times[mask], y.values[mask], x.values[mask], up, topic)


def _up(height: Column | None, mask: NDArray[np.bool_], scale: float) -> NDArray[np.float64]:
    """Return heights above the first one in m, for some samples."""
    if height is None or len(height.values) != len(mask):
        return np.full(int(mask.sum()), np.nan)
    values = height.values[mask] * scale
    known = values[np.isfinite(values)]
    values = values - (known[0] if len(known) else 0.0)
    return np.where(np.abs(values) < _FARTHEST, values, np.nan)


def _globe(recorded: Recorded, topic: str, fields: tuple[str, str, str], scales: tuple[float, float]) -> Track | None:
    lat, lon, alt = (recorded.column(topic, field) for field in fields)
    if lat is None or lon is None:
        return None
    north, east = lat.values * scales[0], lon.values * scales[0]
    mask = (np.abs(north) <= _QUARTER) & (np.abs(east) <= 2 * _QUARTER) & ((north != 0) | (east != 0))
    fix = recorded.column(topic, "fix_type")
    if fix is not None:
        mask &= fix.at(lat.times) >= HAS_FIX
    if not mask.any():
        return None
    north, east = np.radians(north[mask]), np.radians(east[mask])
    turn = (east - east[0] + np.pi) % (2 * np.pi) - np.pi  # across the date line, too
    east, north = turn * np.cos(north[0]) * RADIUS, (north - north[0]) * RADIUS
    return Track(lat.times[mask], east, north, _up(alt, mask, scales[1]), topic)


def figures_of(recorded: Recorded, track: Track | None) -> list[Figure]:
    """Return the numbers about a flight that the recording tells, of the time in which the vehicle was armed."""
    found = [Figure("Duration", duration_text(recorded.duration))]
    is_told = "vehicle_status" in recorded or "actuator_armed" in recorded
    if is_told:
        armed = sum(end - begin for begin, end in recorded.armed)
        found.append(Figure("Time armed", duration_text(armed)))
    return [*found, *_of_motion(recorded, track), *_of_battery(recorded)]


def _of_motion(recorded: Recorded, track: Track | None) -> Iterator[Figure]:
    if track is not None:
        distance, farthest = _distances(recorded, track)
        yield Figure("Distance", _length(distance), "over ground")
        yield Figure("Farthest", _length(farthest), "from the start")
    down = _first_of(recorded, ("vehicle_local_position.z", "vehicle_odometry.position[2]"), "z_valid")
    if down is not None:
        first = float(down.finite[0])
        yield Figure("Highest", f"{first - float(down.finite.min()):.1f} m", "above the start")
    north = _first_of(recorded, ("vehicle_local_position.vx", "vehicle_odometry.velocity[0]"), "v_xy_valid")
    east = _first_of(recorded, ("vehicle_local_position.vy", "vehicle_odometry.velocity[1]"), "v_xy_valid")
    if north is not None and east is not None and len(north.values) == len(east.values):
        speed = np.hypot(north.values, east.values)
        yield Figure("Fastest", f"{np.nanmax(speed):.1f} m/s", "over ground")
    vertical = _first_of(recorded, ("vehicle_local_position.vz", "vehicle_odometry.velocity[2]"), "v_z_valid")
    if vertical is not None:
        up, down_speed = max(-float(vertical.finite.min()), 0.0), max(float(vertical.finite.max()), 0.0)
        yield Figure("Climb and descent", f"{up:.1f}, {down_speed:.1f} m/s", "fastest")
    tilt = tilt_of(recorded)
    tilt = tilt.within(recorded.armed) if tilt is not None else None
    if tilt is not None and len(tilt.finite):
        yield Figure("Largest tilt", f"{tilt.finite.max():.0f}°")


def _of_battery(recorded: Recorded) -> Iterator[Figure]:
    for instance in recorded.batteries():
        number = f" {instance}" if instance else ""
        used, notes = [], []
        share = recorded.while_armed("battery_status", "remaining", instance)
        if share is not None and share.finite[0] >= 0:
            used.append(f"{share.finite[0] * 100:.0f} to {share.finite[-1] * 100:.0f} %")
        spent = recorded.while_armed("battery_status", "discharged_mah", instance)
        if spent is not None and spent.finite[-1] > spent.finite[0]:
            notes.append(f"{spent.finite[-1] - spent.finite[0]:.0f} mAh")
        volts = recorded.while_armed("battery_status", "voltage_v", instance)
        if volts is not None:
            notes.append(f"at least {volts.finite.min():.2f} V")
        if used or notes:
            yield Figure(f"Battery{number}", used[0] if used else notes.pop(0), ", ".join(notes))


def _first_of(recorded: Recorded, paths: Sequence[str], valid: str) -> Column | None:
    """Return the first field that the recording has while the vehicle was armed, NaN where it cannot be used."""
    names = (path.partition(".") for path in paths)
    found = (recorded.while_armed(topic, field, valid=valid) for topic, _, field in names)
    return next(filter(None, found), None)


def _distances(recorded: Recorded, track: Track) -> tuple[float, float]:
    """Return the distance over ground while armed, and the largest one from where the vehicle armed, in m."""
    whole, farthest = 0.0, 0.0
    resets = recorded.column(track.source, "xy_reset_counter")
    for begin, end in recorded.armed:
        chosen = np.flatnonzero((track.times >= begin) & (track.times <= end))
        if not len(chosen):
            continue
        times = track.times[chosen]
        _, firsts = np.unique((times - times[0]) // _STEP, return_index=True)
        at = np.append(chosen[firsts], chosen[-1])
        steps = np.hypot(np.diff(track.east[at]), np.diff(track.north[at]))
        if resets is not None:  # a jump of the estimate is no flight
            steps = steps[np.diff(resets.at(track.times[at])) == 0]
        whole += float(steps.sum())
        east, north = track.east[chosen] - track.east[chosen[0]], track.north[chosen] - track.north[chosen[0]]
        farthest = max(farthest, float(np.hypot(east, north).max()))
    return whole, farthest


def _length(metres: float) -> str:
    return f"{metres / 1000:.2f} km" if metres >= 1000 else f"{metres:.1f} m"  # noqa: PLR2004 - m in a km


def duration_text(seconds: float) -> str:
    """Return `36.9 s`, `2:05 min` or `1:02:05 h`."""
    if seconds < 60:  # noqa: PLR2004 - s in a minute
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02} h" if hours else f"{minutes}:{rest:02} min"


def facts_of(recorded: Recorded) -> Iterator[Figure]:
    """Yield what is known of the vehicle, its firmware and the file, "" for what is not."""
    log = recorded.log
    yield Figure("Vehicle", _vehicle(recorded))
    hardware = [str(log.information.get(name, "")) for name in ("ver_hw", "ver_hw_subtype")]
    yield Figure("Board", ", ".join(filter(None, [*hardware, log.vehicle])))
    airframe = log.parameters.get("SYS_AUTOSTART")
    yield Figure("Airframe", "" if airframe is None else f"SYS_AUTOSTART {airframe:g}")
    branch = log.information.get("ver_sw_branch")
    commit = log.firmware.commit[:12]
    yield Figure("Firmware", str(log.release()))
    yield Figure("Commit", f"{commit} of {branch}" if commit and branch else commit)
    yield Figure(
        "System",
        " ".join(str(log.information.get(name, "")) for name in ("sys_name", "sys_os_name", "sys_mcu")).strip(),
    )
    start = time_of_day(log.start, log.utc_offset)
    yield Figure("Start", f"{start:%Y-%m-%d %H:%M:%S} UTC" if start else "")
    format_ = FORMATS[log.kind].name if log.kind in FORMATS else log.kind
    count = sum(topic.count > 0 for topic in log.topics)
    file = os.path.basename(os.path.abspath(log.path))
    yield Figure("File", f"{file}, {format_}, {counted(count, 'topic')} with samples")


def _vehicle(recorded: Recorded) -> str:
    """Return the kind of the vehicle, and its namespace."""
    samples = recorded.samples("vehicle_status")
    parts = []
    if samples is not None:
        names = samples.array.dtype.names or ()
        row = samples.array[-1]
        if "vehicle_type" in names:
            kinds = annotation_of(samples.topic, "vehicle_type").members
            kind = kinds.get(int(row["vehicle_type"]), f"type {row['vehicle_type']}")
            parts.append(kind.replace("_", " ").lower())
        if "is_vtol" in names and row["is_vtol"]:
            parts.append("VTOL")
    if recorded.namespace:
        parts.append(recorded.namespace)
    return ", ".join(parts)
