"""Tests of angles that are probably in degrees, and of altitudes that lie in the ground."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.flight.checks import Problem
from msggen.flight.errors import LimitError, RefusedError
from msggen.flight.flight import Flight
from msggen.flight.mode import Mode
from msggen.messages.setpoints import FIXED_WING, ROVER
from msggen.sim import Options
from support.flown import Flown, fly


class Turns(Mode, name="Turns"):
    """Calls what it is given."""

    def __init__(self, call: Any, kinds: Any = Mode.setpoints) -> None:
        self.call, self.setpoints = call, kinds  # type: ignore[misc]

    async def fly(self) -> None:
        found = self.call(self)
        if found is not None:
            await found


@pytest.mark.parametrize(
    ("vehicle", "kinds", "call"),
    [
        ("multicopter", Mode.setpoints, lambda mode: mode.goto((0.0, 0.0, -5.0), heading=90.0)),
        ("multicopter", Mode.setpoints, lambda mode: mode.trajectory(velocity=(0.0, 0.0, 0.0), heading=-180.0)),
        ("plane", (FIXED_WING,), lambda mode: mode.fixed_wing(course=90.0)),
        ("plane", (FIXED_WING,), lambda mode: mode.fixed_wing(airspeed_direction=90.0)),
        ("rover", ROVER, lambda mode: mode.rover(speed=1.0, heading=180.0)),
    ],
)
def test_degrees_in_the_place_of_radians_are_an_error(px4_types: Any, vehicle: str, kinds: Any, call: Any) -> None:
    async def program(flight: Flight, flown: Flown) -> None:
        mode = Turns(call, kinds)
        await flight.add(mode)
        await flight.arm()
        if vehicle != "rover":
            await flight.takeoff(30.0 if vehicle == "plane" else 5.0)
        sent = len(flown.sent)
        with pytest.raises(ValueError, match=r"in rad, from -4 pi to 4 pi, got -?\d+: did you mean `\w+_deg=-?\d+`"):
            await flight.fly(mode)
        assert not [each for each in flown.sent[sent:] if getattr(each.message, "yaw", 0.0) in {90.0, 180.0}]

    fly(px4_types, program, Options(vehicle=vehicle))


def test_an_altitude_in_the_ground_is_an_error(px4_types: Any) -> None:
    async def program(flight: Flight, _: Flown) -> None:
        mode = Turns(lambda mode: mode.fixed_wing(course=0.0, altitude=50.0), (FIXED_WING,))
        await flight.add(mode)
        await flight.arm()
        await flight.takeoff(30.0)
        with pytest.raises(
            LimitError, match=r"438.* m below home, and nothing was sent: .* altitudes are above sea level"
        ):
            await flight.fly(mode)

    fly(px4_types, program, Options(vehicle="plane"))


def test_a_refusal_names_the_problems_that_the_program_reports(px4_types: Any) -> None:
    class Track(Turns, name="Track"):
        def problems(self) -> Any:
            return [Problem("track_no_target")]

    async def program(flight: Flight, _: Flown) -> None:
        await flight.add(Track(None))
        await flight.arm()
        await flight.takeoff(5.0)
        with pytest.raises(RefusedError, match="'Track' reports track_no_target"):
            await flight.fly(Track)

    fly(px4_types, program)
