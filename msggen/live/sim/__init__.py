"""Simulated vehicles: clients of DDS-XRCE that behave as PX4's, without PX4."""

from msggen.live.sim.line import Misbehaviour as Misbehaviour
from msggen.live.sim.options import Options as Options
from msggen.live.sim.runner import Simulator as Simulator
from msggen.live.sim.vehicle import SimulatedVehicle as SimulatedVehicle
from msggen.live.sim.world import Home as Home
from msggen.live.sim.world import World as World

__all__ = ["Home", "Misbehaviour", "Options", "SimulatedVehicle", "Simulator", "World"]
