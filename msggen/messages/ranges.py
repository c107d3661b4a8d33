"""The ranges of the fields of setpoints: the parameters of PX4 that limit them, as its documentation has them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from operator import neg
from types import MappingProxyType
from typing import Final, NamedTuple

from msggen.messages.setpoints import FIXED_WING, ROVER, ROVER_POSITION

_GRAVITY = 9.81
_LEVEL = 89.0
"""The largest bank in degrees with which an aircraft turns."""


class Bound(NamedTuple):
    """The largest or smallest value of a field, which a parameter sets."""

    parameter: str
    default: float
    """Its default in PX4. A rover does not move with its defaults, so it is the value of PX4's simulated rover."""
    extreme: float
    """The value in its documented range with which the range of the field is largest."""
    of: Callable[[float], float] = float
    """Returns the bound in the unit of the field."""


class Range(NamedTuple):
    """What a vehicle can do. PX4 reduces or raises other values to the nearest bound, and does not say so."""

    what: str
    """For messages."""
    unit: str
    least: Bound
    most: Bound


def _sideways(bank: float) -> float:
    """Return the lateral acceleration in m/s^2 at a bank in degrees."""
    return _GRAVITY * math.tan(math.radians(min(bank, _LEVEL)))


def _on_both_sides(what: str, unit: str, bound: Bound) -> Range:
    return Range(what, unit, bound._replace(of=lambda value: -bound.of(value)), bound)


AIRSPEED: Final = Range(
    "an airspeed",
    "m/s",
    Bound("FW_AIRSPD_MIN", 10.0, 0.5),
    Bound("FW_AIRSPD_MAX", 20.0, 100.0),  # no documented maximum: that of EKF2_VEL_LIM, the fastest PX4 estimates
)
HEIGHT_RATE: Final = Range(
    "a height rate", "m/s", Bound("FW_T_SINK_MAX", 5.0, 15.0, neg), Bound("FW_T_CLMB_MAX", 5.0, 15.0)
)
SPEED: Final = _on_both_sides("a speed", "m/s", Bound("RO_SPEED_LIM", 3.0, 100.0))
TURN_RATE: Final = _on_both_sides("a turn rate", "rad/s", Bound("RO_YAW_RATE_LIM", 180.0, 10_000.0, math.radians))
_LATERAL, _LONGITUDINAL = FIXED_WING.topics[:2]
_BY_HEADING, _BY_RATE = ROVER[1:3]
RANGES: Final[Mapping[str, Mapping[str, Range]]] = MappingProxyType(
    {
        _LATERAL: {
            "lateral_acceleration": _on_both_sides(
                "a lateral acceleration", "m/s^2", Bound("FW_R_LIM", 50.0, 75.0, _sideways)
            )
        },
        _LONGITUDINAL: {"equivalent_airspeed": AIRSPEED, "height_rate": HEIGHT_RATE},
        _BY_HEADING.topics[0]: {"speed_body_x": SPEED},
        _BY_RATE.topics[1]: {"yaw_rate_setpoint": TURN_RATE},
        ROVER_POSITION.topic: {"cruising_speed": SPEED},
    }
)
"""The ranges of fields, by the topics of their messages. PX4 tells none of these parameters over DDS."""
DEFAULTS: Final[Mapping[str, float]] = MappingProxyType(
    {
        bound.parameter: bound.default
        for fields in RANGES.values()
        for each in fields.values()
        for bound in (each.least, each.most)
    }
)
"""The parameters that limit setpoints."""
