"""The kinds of vehicles that are simulated, as the airframes of PX4's own simulator (SIH)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, ROVER
from msggen.sim.parts import checked


class Airframe(NamedTuple):
    """A kind of vehicle."""

    vehicle_type: int
    """That of VehicleStatus on the ground."""
    system_type: int
    """MAV_TYPE."""
    parts: Sequence[str] = ()
    """The parts that PX4's simulator has for it: those of `PARTS`."""
    parameters: Mapping[str, float] = {}
    """The defaults that differ from those of a multicopter."""
    is_vtol: bool = False
    is_tailsitter: bool = False
    turns_in_place: bool = False
    """Whether a rover turns by the speeds of its sides, and not by its front wheels."""


_WINGS: Final = {"COM_DISARM_PRFLT": -1.0, "MIS_TAKEOFF_ALT": 25.0, "RTL_RETURN_ALT": 100.0, "RTL_TYPE": 1.0}
_VTOL: Final = {"FW_AIRSPD_MIN": 7.0, "FW_AIRSPD_TRIM": 10.0, "FW_AIRSPD_MAX": 12.0}
_TAILSITTER: Final = {**_VTOL, "VT_B_TRANS_DUR": 5.0}
AIRFRAMES: Mapping[str, Airframe] = MappingProxyType(
    {
        "multicopter": Airframe(ROTARY_WING, 2),
        "plane": Airframe(FIXED_WING, 1, ("airspeed",), _WINGS),
        "vtol": Airframe(ROTARY_WING, 22, ("airspeed", "vtol"), _VTOL, is_vtol=True),
        "tailsitter": Airframe(ROTARY_WING, 20, ("airspeed", "vtol"), _TAILSITTER, is_vtol=True, is_tailsitter=True),
        "rover": Airframe(ROVER, 10),
        "differential": Airframe(ROVER, 10, turns_in_place=True),
    }
)
"""Those of `msggen sim --vehicle`."""


def airframe_of(name: str) -> Airframe:
    """Return the airframe of a kind of vehicle. Raises ValueError for another one."""
    return AIRFRAMES[checked("vehicle", name, AIRFRAMES)]
