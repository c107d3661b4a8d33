"""Angles of a vehicle, from the quaternions that PX4 sends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from msggen.exports.report.recorded import Column, Recorded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_QUATERNIONS = ("q", "q_d")


def angle_of(recorded: Recorded, topic: str, name: str) -> Column | None:
    """Return `roll`, `pitch` or `yaw` in deg from the quaternion of a topic, None if it does not have one."""
    for field in _QUATERNIONS if name in ("roll", "pitch", "yaw") else ():
        parts = [recorded.column(topic, f"{field}[{index}]") for index in range(4)]
        found = [part for part in parts if part is not None]
        if len(found) == len(parts):
            values = _angle(name, [part.values for part in found])
            return found[0]._replace(values=values, unit="deg", path=found[0].path.replace("[0]", ""))
    return None


def _angle(name: str, quaternion: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return an angle of rotations from FRD to NED: yaw, then pitch, then roll."""
    w, x, y, z = quaternion
    norm = w * w + x * x + y * y + z * z
    with np.errstate(all="ignore"):
        w, x, y, z = (each / np.sqrt(norm) for each in (w, x, y, z))
        if name == "roll":
            found = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        elif name == "pitch":
            found = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
        else:
            found = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(np.where(norm > 0, found, np.nan))


def tilt_of(recorded: Recorded) -> Column | None:
    """Return the angle in deg between down in the body and down, None if the recording does not tell it."""
    for topic in ("vehicle_attitude", "vehicle_odometry"):
        roll, pitch = (angle_of(recorded, topic, name) for name in ("roll", "pitch"))
        if roll is not None and pitch is not None:
            cosine = np.cos(np.radians(roll.values)) * np.cos(np.radians(pitch.values))
            return roll._replace(values=np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return None
