"""Measurements of programs for PX4's estimator, EKF2: where a camera, a beacon or the like sees the vehicle.

The facts are those of EKF2 in v1.15 to v1.18 (`EKF2.cpp`, `aid_sources/external_vision`, `aux_global_position`), and
were measured with v1.18. EKF2 drops what it cannot use without a word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple

LOCAL: Final = "vehicle_visual_odometry"
"""The topic of positions, velocities and attitudes: VehicleOdometry."""
GLOBAL: Final = "aux_global_position"
"""The topic of places on earth: VehicleGlobalPosition, from v1.18 on AuxGlobalPosition."""

UNREAD: Final = "vehicle_mocap_odometry"
"""A topic of VehicleOdometry that the bridge takes, and EKF2 does not read."""

OLDEST: Final = 0.3
"""The age in s from which on EKF2 does not use a measurement."""
NEAREST: Final = 0.01
"""The time in s between two measurements below which EKF2 drops the second one."""
LONGEST_START: Final = 0.2
"""The time in s between two measurements with which EKF2 still starts to use them: 5 Hz."""
SLOWEST: Final = 1.0 / LONGEST_START


class Part(NamedTuple):
    """A part of the estimate that measurements can give."""

    name: str
    flag: str
    """The field of EstimatorStatusFlags that tells whether it is fused."""
    bit: int
    """Its bit in the parameter that switches it on."""
    topic: str = LOCAL


POSITION: Final = Part("position", "cs_ev_pos", 1)
HEIGHT: Final = Part("height", "cs_ev_hgt", 2)
VELOCITY: Final = Part("velocity", "cs_ev_vel", 4)
YAW: Final = Part("attitude", "cs_ev_yaw", 8)
PLACE: Final = Part("place on earth", "cs_aux_gpos", 1, GLOBAL)
PARTS: Final = (POSITION, HEIGHT, VELOCITY, YAW, PLACE)

UNKNOWN, NED, FRD, BODY_FRD = range(4)
"""The frames of VehicleOdometry: POSE_FRAME_* and VELOCITY_FRAME_*. An FRD frame is level, and its x axis points
anywhere."""
SOURCES: Final = ("unknown", "gnss", "vision", "pseudolites", "terrain", "magnetic", "estimator", "leo")
"""The sources of AuxGlobalPosition by their numbers, SOURCE_*. The filter does not look at them."""
_UNIT: Final = 1e-5
"""How far from 1 the length of a quaternion may be."""


class _Group(NamedTuple):
    """Parts that depend on the same fields."""

    parts: tuple[Part, ...]
    field: str
    frame: str = ""
    """The field with its frame, "" if the frame does not count."""
    frames: tuple[int, ...] = ()
    """The frames that EKF2 knows."""


_GROUPS: Final = (
    _Group((POSITION, HEIGHT), "position", "pose_frame", (NED, FRD)),
    _Group((VELOCITY,), "velocity", "velocity_frame", (NED, FRD, BODY_FRD)),
    _Group((YAW,), "q"),
)


def is_unit(q: Sequence[float]) -> bool:
    """Whether a quaternion has finite numbers and the length 1, as far as EKF2 wants it."""
    return all(map(math.isfinite, q)) and abs(math.hypot(*q) - 1.0) <= _UNIT


def taken(values: Mapping[str, Any]) -> frozenset[Part]:
    """Return the parts of a VehicleOdometry that EKF2 takes, if its parameters let it."""
    return frozenset(part for group in _GROUPS if _problem(group, values) == "" for part in group.parts)


def dropped(values: Mapping[str, Any]) -> Iterator[str]:
    """Yield what EKF2 drops of a VehicleOdometry, and what to do. What has no number at all is not meant."""
    found = [_problem(group, values) for group in _GROUPS]
    yield from filter(None, found)
    if not any(each is not None for each in found):
        yield "has no position, velocity or attitude: set one of them, with its frame"


def _problem(group: _Group, values: Mapping[str, Any]) -> str | None:
    """Return why EKF2 drops the parts of a group, "" if it takes them, None if they are not meant."""
    numbers = values.get(group.field, ())
    frame = values.get(group.frame, UNKNOWN)
    is_known = not group.frame or frame in group.frames
    if all(map(math.isnan, numbers)) or (not any(numbers) and (not is_known or not group.frame)):
        return None
    if not group.frame:
        return "" if is_unit(numbers) else f"has `q` = {_shown(numbers)}: set a unit quaternion, w first"
    if not all(map(math.isfinite, numbers)):
        return (
            f"has `{group.field}` = {_shown(numbers)}, which EKF2 drops: set all three numbers, and a large variance "
            "for what is not measured"
        )
    if not is_known:
        return f"has `{group.frame}` = {frame}: set 1 (NED) or 2 (FRD)"
    return ""


def _shown(numbers: Sequence[float]) -> str:
    return f"({', '.join(f'{each:g}' for each in numbers)})"


def switch(part: Part, release_has_ids: bool, identity: int = 1) -> str:  # noqa: FBT001 - of the layout
    """Return how parameters of PX4 switch the fusion of a part on, for people."""
    if part is not PLACE:
        return f"the bit {part.bit} of EKF2_EV_CTRL ({part.name})"
    if release_has_ids:
        return f"EKF2_AGP0_CTRL 1 with EKF2_AGP0_ID {identity}, which PX4 reads when it starts (or those of AGP1 to 3)"
    return "EKF2_AGP_CTRL 1"


REJECTIONS: Final[Mapping[Part, str]] = MappingProxyType(
    {
        POSITION: "reject_hor_pos",
        HEIGHT: "reject_ver_pos",
        VELOCITY: "reject_hor_vel",
        YAW: "reject_yaw",
        PLACE: "reject_hor_pos",
    }
)
"""The fields of EstimatorStatusFlags that tell that measurements are rejected, up to v1.17."""


def reason(part: Part, flags: Mapping[str, Any], *, is_ned: bool, has_ids: bool, identity: int = 1) -> str:
    """Return the likely reason why good measurements of a part are not fused, by the values of EstimatorStatusFlags.

    `is_ned` says whether their frame is NED, and `has_ids` whether the release has several global sources.
    """
    if flags.get("cs_tilt_align") is False:
        return "EKF2 has not found its attitude yet"
    if part is YAW and flags.get("cs_ev_yaw_fault"):
        return "EKF2 takes its yaw for wrong (cs_ev_yaw_fault): raise the reset counter, or correct the frame"
    if part in {POSITION, PLACE} and is_ned and flags.get("cs_yaw_align") is False:
        return (
            "it is in NED, and EKF2 does not know north (cs_yaw_align is false): it needs a magnetometer or GPS, or "
            "measurements in FRD"
        )
    if flags.get(REJECTIONS[part]):
        return (
            f"EKF2 rejects it ({REJECTIONS[part]}), because it is too far from the estimate for its variance: raise "
            "the variance, or the reset counter after a jump"
        )
    return f"{switch(part, has_ids, identity)} is probably not set"
