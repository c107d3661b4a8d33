"""Places and directions in the frames that a program chooses: NED as in PX4, or ENU as in ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias, get_args

_TURNS = 2 * math.tau
"""The largest angle in rad: programs that fly around something sum them up."""

Frame: TypeAlias = Literal["ned", "enu"]
"""Axes: north, east, down; or east, north, up."""


def check_frame(frame: Frame) -> Frame:
    """Return a frame. Raises ValueError for another word."""
    if frame not in get_args(Frame):
        raise ValueError(f"expected the frame {' or '.join(map(repr, get_args(Frame)))}, got {frame!r}")
    return frame


class Vector(NamedTuple):
    """A place in m or a velocity in m/s, in the frame of the program."""

    x: float
    y: float
    z: float

    def shifted(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Vector:
        """Return the place that is shifted along the axes, in m."""
        return Vector(self.x + x, self.y + y, self.z + z)

    def distance(self, other: Vector) -> float:
        """Return the distance to another place in m."""
        return math.dist(self, other)


def turned(vector: tuple[float, float, float], frame: Frame) -> Vector:
    """Convert a vector from NED to a frame, or from a frame to NED: both are the same computation."""
    x, y, z = vector
    return Vector(x, y, z) if frame == "ned" else Vector(y, x, -z)


def turned_heading(heading: float, frame: Frame) -> float:
    """Convert a heading in rad from NED (clockwise from north) to ENU (counter-clockwise from east), or back."""
    return heading if frame == "ned" else wrapped(math.pi / 2 - heading)


def heading_of(heading: float | None, heading_deg: float | None, frame: Frame) -> float | None:
    """Return a heading in a frame, in rad or in degrees, as one in NED in rad.

    Raises ValueError if both are given, for one that is not finite, and for radians beyond two turns.
    """
    if heading is not None and heading_deg is not None:
        raise ValueError("expected heading or heading_deg, got both")
    found = math.radians(heading_deg) if heading_deg is not None else heading
    if found is not None and not math.isfinite(found):
        raise ValueError(f"expected finite numbers for a heading, got {(found,)}")
    if heading is not None:
        check_radians(heading, "heading")
    return None if found is None else turned_heading(found, frame)


def check_radians(angle: float, name: str) -> None:
    """Raise ValueError for an angle beyond two turns, which is probably in degrees. `name` is its argument."""
    if abs(angle) > _TURNS:
        raise ValueError(
            f"expected `{name}` in rad, from -4 pi to 4 pi, got {angle:g}: did you mean `{name}_deg={angle:g}`?"
        )


def three(values: Sequence[float]) -> tuple[float, float, float]:
    """Return three numbers. Raises ValueError for another count."""
    found = tuple(map(float, values))
    if len(found) != 3:  # noqa: PLR2004 - x, y, z
        raise ValueError(f"expected three numbers, got {found}")
    return found


def wrapped(angle: float) -> float:
    """Return an angle in rad as one from -pi to pi."""
    return math.remainder(angle, math.tau)
