"""The parts of a simulated vehicle that move it: its motion, its pilot, and its land detector."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from msggen.messages.vehicle_types import FIXED_WING, ROVER
from msggen.sim.airframes import Airframe
from msggen.sim.autopilot import Autopilot
from msggen.sim.commander.rules import Rules
from msggen.sim.flight import Flight
from msggen.sim.landing import LandDetector, PlaneLandDetector, RoverLandDetector, VtolLandDetector
from msggen.sim.rover_pilot import RoverPilot
from msggen.sim.setpoints import Setpoints
from msggen.sim.vtol_pilot import VtolPilot
from msggen.sim.wheels import Wheels
from msggen.sim.wing_pilot import WingPilot
from msggen.sim.wings import Wings

Pilot: TypeAlias = Autopilot | WingPilot | VtolPilot | RoverPilot
Landing: TypeAlias = LandDetector | PlaneLandDetector | RoverLandDetector


def model_of(
    airframe: Airframe, setpoints: Setpoints, parameters: Mapping[str, float], rules: Rules
) -> tuple[Flight, Pilot, Landing]:
    """Return what moves an airframe, at rest on the ground."""
    if airframe.vehicle_type == ROVER:
        turns = airframe.turns_in_place
        wheels = Wheels(turns_in_place=turns)
        driver = RoverPilot(wheels, setpoints, turns_in_place=turns)
        return wheels, driver, RoverLandDetector(driver)
    if airframe.is_vtol:
        body = Wings(parameters, is_tailsitter=airframe.is_tailsitter)
        vtol = VtolPilot(body, setpoints, parameters, pushes_in_modes=rules.pushes_in_modes)
        return body, vtol, VtolLandDetector(body, vtol)
    if airframe.vehicle_type == FIXED_WING:
        wings = Wings(parameters)
        return wings, WingPilot(wings, setpoints, parameters), PlaneLandDetector(wings)
    flight = Flight()
    autopilot = Autopilot(flight, setpoints, parameters)
    return flight, autopilot, LandDetector(flight, autopilot)
