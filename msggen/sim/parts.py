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


def check_part(name: str) -> None:
    """Raise ValueError for what is no part."""
    if name not in PARTS:
        raise ValueError(f"no part '{name}'{suggestion(name, PARTS)}: there are {', '.join(PARTS)}")


def missing(parts: Collection[str]) -> frozenset[str]:
    """Return the topics that a vehicle with some parts does not have. Raises ValueError for what is no part."""
    for name in parts:
        check_part(name)
    return frozenset().union(*(topics for name, topics in PARTS.items() if name not in parts))
