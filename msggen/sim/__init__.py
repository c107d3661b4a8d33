"""Simulated vehicles: clients of DDS-XRCE that behave as PX4's, without PX4."""

from msggen.sim.line import Misbehaviour as Misbehaviour
from msggen.sim.options import Options as Options
from msggen.sim.places import Home as Home
from msggen.sim.runner import Simulator as Simulator
from msggen.sim.vehicle import SimulatedVehicle as SimulatedVehicle
from msggen.sim.world import World as World

__all__ = ["Home", "Misbehaviour", "Options", "SimulatedVehicle", "Simulator", "World"]
