"""The parts that a simulated vehicle can have beside those of PX4's simulated multicopter, and their topics."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Final

from msggen.base.diagnostics import suggestion

POWER_MODULE: Final = "power-module"
"""It measures the current: PX4's simulator of a battery does not."""
PARTS: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "airspeed": frozenset({"airspeed_validated", "wind"}),
        "gimbal": frozenset({"gimbal_device_attitude_status"}),
        "obstacle-sensor": frozenset({"collision_constraints"}),
        POWER_MODULE: frozenset(),
        "receiver": frozenset({"input_rc", "manual_control_setpoint"}),
        "transponder": frozenset({"transponder_report"}),
        "video-transmitter": frozenset({"vtx"}),
        "vtol": frozenset({"vtol_vehicle_status"}),
    }
)
"""The topics that only a vehicle with a part publishes, by the name of the part."""


def checked(what: str, name: str, known: Collection[str]) -> str:
    """Return a name that is known. Raises ValueError for another one, and says what it was to name."""
    if name not in known:
        raise ValueError(f"no {what} '{name}'{suggestion(name, known)}: there are {', '.join(known)}")
    return name


def missing(parts: Collection[str]) -> frozenset[str]:
    """Return the topics that a vehicle with some parts does not have."""
    return frozenset().union(*(topics for name, topics in PARTS.items() if name not in parts))
