"""Simulated vehicles with sockets or a serial device, and the clock of the system."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

from msggen.live.sim.runner import Runner
from msggen.live.sim.transport import DEFAULT_ADDRESS, read_address
from msggen.live.sim.vehicle import Options, SimulatedVehicle


class Simulator(Runner):
    """Vehicles that connect to one agent.

        with Simulator(px4_types, "udp://127.0.0.1:8888") as simulator:
            ...  # the vehicles run in a thread

        Simulator(px4_types).serve(10.0)  # in this thread, for 10 s

    `vehicles` tells their state. It changes while the thread runs.
    """

    def __init__(
        self, package: ModuleType, address: str = DEFAULT_ADDRESS, options: Sequence[Options] = (Options(),)
    ) -> None:
        """Open the connections of a vehicle for each of `options`.

        `package` is a package that msggen generated. Raises ValueError for an address that is none, and LinkError if
        it cannot be opened.
        """
        self.vehicles = tuple(SimulatedVehicle(package, each) for each in options)
        super().__init__(self.vehicles, read_address(address))
