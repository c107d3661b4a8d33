"""Measurements of programs for PX4's estimator, EKF2: where a camera, a beacon or the like sees the vehicle.

The facts are those of EKF2 in v1.15 to v1.18 (`EKF2.cpp`, `aid_sources/external_vision`, `aux_global_position`), and
were measured with v1.18. EKF2 drops what it cannot use without a word.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from msggen.messages.earth import local

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


class Gate(NamedTuple):
    """How far a measurement may be from the estimate, along each axis: EKF2 rejects what is farther."""

    deviations: float
    """In standard deviations of both together."""
    least: float
    """The least standard deviation of a measurement."""

    def width(self, variance: float, of_estimate: float) -> float:
        """Return it in the unit of the part. A variance that is not finite counts as the least one."""
        least = self.least * self.least
        own = max(least, variance) if math.isfinite(variance) else least
        return self.deviations * math.sqrt(own + max(0.0, of_estimate))


GATES: Final[Mapping[Part, Gate]] = MappingProxyType(
    {
        POSITION: Gate(5.0, 0.1),
        HEIGHT: Gate(5.0, 0.1),
        VELOCITY: Gate(3.0, 0.1),
        YAW: Gate(2.6, 0.1),
        PLACE: Gate(3.0, 0.9),
    }
)
"""The defaults of EKF2_EVP_GATE, EKF2_EVV_GATE, EKF2_HDG_GATE and EKF2_AGP_GATE, and of EKF2_EVP_NOISE, EKF2_EVV_NOISE,
EKF2_EVA_NOISE and EKF2_AGP_NOISE (1 m in v1.18)."""
STARTING: Final = math.sqrt(10.0)
"""How much wider the gate of a velocity is that begins beside another source of the horizontal motion."""
FASTEST: Final = 100.0
"""The speed in m/s above which EKF2 drops a velocity: EKF2_VEL_LIM."""

UNKNOWN, NED, FRD, BODY_FRD = range(4)
"""The frames of VehicleOdometry: POSE_FRAME_* and VELOCITY_FRAME_*. An FRD frame is level, and its x axis points
anywhere."""
SOURCES: Final = ("unknown", "gnss", "vision", "pseudolites", "terrain", "magnetic", "estimator", "leo")
"""The sources of AuxGlobalPosition by their numbers, SOURCE_*. The filter does not look at them."""
_BEST: Final = 100
"""The best `quality` of a VehicleOdometry."""
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


_BY_GPS: Final = ("cs_gnss_pos", "cs_gps")
"""The flags that tell that GPS gives the position. The second one is that of v1.15."""
_AIDING: Final = (*_BY_GPS, "cs_gnss_vel", "cs_ev_pos", "cs_ev_vel", "cs_aux_gpos", "cs_opt_flow")
"""Those of what keeps the horizontal motion from drifting."""
_LONGEST: Final = 0.5
"""The time in s between a measurement and an estimate that can be compared."""
_MANY: Final = 10
"""The number from which on numbers have no decimals."""
_LAG: Final = 0.1
"""The time in s by which measurement and estimate can be apart all the same."""


def frame_of(values: Mapping[str, Any]) -> int:
    """Return the frame of the position and attitude of a VehicleOdometry. Without a position, EKF2 takes FRD."""
    frame = values.get("pose_frame", UNKNOWN)
    has_position = all(map(math.isfinite, values.get("position", (math.nan,))))
    return frame if has_position and frame in {NED, FRD} else FRD


def reason(
    part: Part, sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any], *, was_fused: bool = False
) -> str:
    """Return why EKF2 does not use a part of measurements that are good in themselves, "" if it does.

    `sent` has the values of the newest one, `flags` those of EstimatorStatusFlags, and `place` those of the
    VehicleLocalPosition of about the same time, if it is known. What only a parameter can explain is blamed on it.
    """
    if flags.get(part.flag):
        return _rejection(part, sent, flags, place)
    return _unready(part, sent, flags) or _rejection(part, sent, flags, place) or _switch(part, sent, was_fused)


def _unready(part: Part, sent: Mapping[str, Any], flags: Mapping[str, Any]) -> str:
    """Return what EKF2 lacks to begin with a part, whatever its value."""
    if flags.get("cs_tilt_align") is False:
        return "EKF2 has not found its attitude yet"
    knows_north = flags.get("cs_yaw_align") is not False
    if part is YAW:
        if flags.get("cs_ev_yaw_fault"):
            return "EKF2 takes its yaw for wrong (cs_ev_yaw_fault): raise the reset counter, or correct the frame"
        if frame_of(sent) == FRD and knows_north and _has_gps(flags):
            why = "it is in FRD" if sent.get("pose_frame") == FRD else "without a position, it counts as one in FRD"
            return f"{why}, and EKF2 uses only a heading in NED beside GPS: send both in NED"
    frame = sent.get("velocity_frame", NED) if part is VELOCITY else NED if part is PLACE else frame_of(sent)
    if part not in {HEIGHT, YAW} and frame == NED and not knows_north:
        return (
            "it is in NED, and EKF2 does not know north (cs_yaw_align is false): it needs a magnetometer or GPS, or "
            "measurements in FRD"
        )
    return ""


def _has_gps(flags: Mapping[str, Any]) -> bool:
    return any(flags.get(name) for name in _BY_GPS)


class _Offset(NamedTuple):
    """How far a measurement is from the estimate along an axis, and how far it may be."""

    axis: str
    amount: float
    width: float
    unit: str


def _rejection(part: Part, sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> str:
    """Return how far a measurement is from the estimate if EKF2 rejects it for that, or "".

    Nothing tells that in v1.18. Up to v1.17 there are flags, of which EKF2 sets only `reject_yaw`.
    """
    if part is VELOCITY and math.hypot(*sent["velocity"]) > FASTEST:
        return f"it is faster than {FASTEST:g} m/s, EKF2_VEL_LIM"
    compare = _COMPARED.get(part)
    found = [*compare(sent, flags, place)] if compare and place else []
    worst = max(found, key=lambda each: abs(each.amount) / each.width, default=None)
    cure = "raise its variance, or the reset counter after a jump"
    if worst is not None and abs(worst.amount) > worst.width:
        axis, amount, width, unit = worst
        far, near = (f"{each:,.0f}" if each >= _MANY else f"{each:.2g}" for each in (abs(amount), width))
        return f"{axis} is {far} {unit} from the estimate, and EKF2 takes {near} {unit}: {cure}"
    return f"EKF2 rejects it (reject_yaw): {cure}" if part is YAW and flags.get("reject_yaw") else ""


def _off_position(sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> Iterator[_Offset]:
    """A position begins wherever it is. Beside GPS, EKF2 learns its distance from the estimate."""
    if not flags.get(POSITION.flag) or _has_gps(flags) or not (frame_of(sent) == NED or flags.get(YAW.flag)):
        return
    own, speed = _moved(sent, place)
    for axis, value, here, variance in zip("xy", sent["position"], own, _variances(sent, "position"), strict=False):
        yield _Offset(axis, value - here, _reach(POSITION, variance, place) + _LAG * speed, "m")


def _off_velocity(sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> Iterator[_Offset]:
    """A velocity begins whatever it is if nothing else is there. Without the attitude, its length is compared."""
    is_fused = flags.get(VELOCITY.flag)
    if not is_fused and not any(flags.get(name) for name in _AIDING):
        return
    own, changes = _moved(sent, place, ("vx", "vy", "vz"), ("ax", "ay", "az"))
    of_estimate = max(place["evh"] ** 2 / 2, place["evv"] ** 2)
    wider, lag = 1.0 if is_fused else STARTING, _LAG * changes
    widths = [GATES[VELOCITY].width(each, of_estimate) * wider + lag for each in _variances(sent, "velocity")]
    turn = _turn(sent, flags, place)
    if turn is not None:
        x, y, z = sent["velocity"]
        velocity = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z
        for axis, value, here, width in zip(("vx", "vy", "vz"), velocity, own, widths, strict=True):
            yield _Offset(axis, value - here, width, "m/s")
    else:
        amount = math.hypot(*sent["velocity"]) - math.hypot(*own)
        yield _Offset("the speed", amount, max(widths) * (math.sqrt(3.0) if is_fused else 1.0), "m/s")


def _turn(sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> float | None:
    """Return the angle from the frame of a velocity to that of the estimate, None if that needs its attitude."""
    frame, heading = sent.get("velocity_frame"), place["heading"]
    if not math.isfinite(heading) or (frame == BODY_FRD and flags.get("cs_in_air")):
        return None
    if frame == BODY_FRD:
        return float(heading)
    is_turned = frame == FRD and not flags.get(YAW.flag) and is_unit(sent.get("q", (math.nan,) * 4))
    return heading - _yaw_of(sent["q"]) if is_turned else 0.0


def _yaw_of(q: Sequence[float]) -> float:
    w, x, y, z = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _off_yaw(sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> Iterator[_Offset]:
    """On the ground, and in FRD, a heading begins whatever it is."""
    if flags.get(YAW.flag) or (flags.get("cs_in_air") and frame_of(sent) == NED):
        width = GATES[YAW].width(_variances(sent, "orientation")[2], place.get("heading_var", 0.0))
        error = _yaw_of(sent["q"]) - place["heading"]
        amount = math.remainder(error, math.tau) if math.isfinite(error) else math.nan
        yield _Offset("the heading", math.degrees(amount), math.degrees(width), "degrees")


def _off_place(sent: Mapping[str, Any], flags: Mapping[str, Any], place: Mapping[str, Any]) -> Iterator[_Offset]:
    """A place on earth begins wherever it is if nothing else gives the position."""
    others = any(flags.get(name) for name in (*_BY_GPS, POSITION.flag))
    if place["xy_global"] and (flags.get(PLACE.flag) or others):
        goal = local((place["ref_lat"], place["ref_lon"]), sent["lat"], sent["lon"])
        own, speed = _moved(sent, place)
        width = _reach(PLACE, sent.get("eph", 0.0) ** 2, place) + _LAG * speed
        for axis, value, here in zip(("latitude", "longitude"), goal, own, strict=True):
            yield _Offset(f"the {axis}", value - here, width, "m")


_COMPARED: Final = MappingProxyType(
    {POSITION: _off_position, VELOCITY: _off_velocity, YAW: _off_yaw, PLACE: _off_place}
)
"""What is compared. A height is not: it has a distance of its own from the estimate, unless it is the reference."""


def _variances(sent: Mapping[str, Any], name: str) -> Sequence[float]:
    found: Sequence[float] = sent.get(f"{name}_variance", (math.nan,) * 3)
    return found if all(map(math.isfinite, found)) else (math.nan,) * 3


def _moved(
    sent: Mapping[str, Any], place: Mapping[str, Any], names: Sequence[str] = "xy", rates: Sequence[str] = ("vx", "vy")
) -> tuple[list[float], float]:
    """Return what an estimate was at the time of a measurement, and how fast it changes."""
    seconds = (sent.get("timestamp_sample", 0) - place.get("timestamp_sample", 0)) / 1e6
    seconds = seconds if abs(seconds) < _LONGEST else 0.0
    values = [place[name] + place[rate] * seconds for name, rate in zip(names, rates, strict=True)]
    return values, math.hypot(*(place[rate] for rate in rates))


def _reach(part: Part, variance: float, place: Mapping[str, Any]) -> float:
    """Return how far a horizontal position may be."""
    return GATES[part].width(variance, place["eph"] ** 2 / 2)


def _switch(part: Part, sent: Mapping[str, Any], was_fused: bool) -> str:  # noqa: FBT001 - as `reason` has it
    """Return the parameter that can be the reason, when there is nothing else."""
    if was_fused:
        return "it was before: PX4's console tells why EKF2 has stopped it"
    quality = sent.get("quality", _BEST)
    doubt = f", or EKF2_EV_QMIN is above its `quality`, {quality}" if quality < _BEST else ""
    return f"{switch(part, 'id' in sent, int(sent.get('id', 1)))} is probably not set{doubt}"
