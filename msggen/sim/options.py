"""The options of a simulated vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias

from msggen.link.xrce.client_entities import Sync
from msggen.sim.airframes import airframe_of
from msggen.sim.line import Misbehaviour
from msggen.sim.parameters import PARAMETERS
from msggen.sim.parts import PARTS, checked
from msggen.sim.places import Home

Board: TypeAlias = Literal["most", "sitl"]
"""The board that the firmware is built for: most boards, or px4_sitl, which has all messages of the release."""


class Options(NamedTuple):
    """The options of a simulated vehicle."""

    key: int = 1
    """The key of the client and the system id of the vehicle: UXRCE_DDS_KEY and MAV_SYS_ID, from 1 to 255."""
    namespace: str = ""
    vehicle: str = "multicopter"
    """The kind of vehicle: one of `AIRFRAMES` in msggen.sim.airframes."""
    rate: float | None = None
    """The rate in Hz at which all topics are published, None for the rate of each."""
    sync: Sync = "px4"
    seed: int = 0
    """Of the noise of sensors and of what goes wrong."""
    misbehaviour: Misbehaviour = Misbehaviour()
    home: Home = Home()
    board: Board = "most"
    """Decides the object ids of topics out, if the release has messages that only some boards have."""
    is_on_zenoh: bool = False
    """Whether the vehicle has PX4's module `zenoh`, and no client of DDS-XRCE."""
    zenoh_tokens: bool = True
    """Whether the firmware has CONFIG_ZENOH_RMW_LIVELINESS."""
    zenoh_hashes: bool = True
    """Whether the firmware has CONFIG_ZENOH_KEY_TYPE_HASH."""
    parameters: Mapping[str, float] = MappingProxyType({})
    """Parameters of PX4 that differ from their defaults: those of `SETTABLE` in msggen.sim.parameters."""
    faults: Sequence[tuple[float, str]] = ()
    """What happens at times in s after the start, such as `(20.0, "no-position")`: `SimulatedVehicle.fault`."""
    parts: Sequence[str] = ()
    """The parts that the vehicle has, such as "gimbal": those of `PARTS` in msggen.sim.parts."""
    disturbances: Sequence[str] = ()
    """What makes flying hard, such as "wind": those of `DISTURBANCES` in msggen.sim.disturbances."""

    @property
    def followed(self) -> Mapping[str, float]:
        """The parameters that the vehicle follows: PX4's defaults, those of its kind, and its own."""
        return {**PARAMETERS, **airframe_of(self.vehicle).parameters, **self.parameters}

    @property
    def equipment(self) -> frozenset[str]:
        """All parts of the vehicle. Raises ValueError for an unknown kind of vehicle, and for what is no part."""
        return frozenset((*airframe_of(self.vehicle).parts, *(checked("part", each, PARTS) for each in self.parts)))
