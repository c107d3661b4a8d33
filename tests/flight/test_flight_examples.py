"""The examples of flights, flown on the clock of simulated vehicles."""

from __future__ import annotations

import asyncio
import importlib.util
import math
from collections.abc import Coroutine
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight import Flight, Limits
from msggen.sim import Options
from msggen.sim.disturbances import DISTURBANCES, WIND
from msggen.sim.loop import run
from support.examples import by_day
from support.flown import Flown
from support.repository import ROOT

FOLDER = ROOT / "examples" / "flight"
LIMITS = Limits(height=20.0, distance=100.0)
HOLD, RETURN, OFFBOARD, TAKEOFF, LAND, EXTERNAL = 4, 5, 14, 17, 18, 23

Place = tuple[float, float, float]


class Tracked(Flown):
    """A vehicle that keeps where it was, and in which modes."""

    def __init__(self, package: Any, options: Options = Options()) -> None:  # noqa: B008 - it is immutable
        super().__init__(package, options)
        self.track: list[tuple[float, int, Place]] = []
        """Times in s, modes, and places: north and east of the start, and down from the ground below, in m."""

    def advance(self, now: int) -> None:
        super().advance(now)
        flight = self.world.flight
        north, east, down = flight.position
        self.track.append((now / 1e6, self.world.mode, (north, east, down - flight.ground)))

    @property
    def modes(self) -> list[int]:
        """The modes in their order."""
        found = [mode for _, mode, _ in self.track]
        return [mode for before, mode in zip([-1, *found], found, strict=False) if mode != before]

    def nearest(self, north: float, east: float) -> float:
        """Return how near the vehicle came to a place, horizontally, in its mode of the program."""
        return min(math.dist(each[:2], (north, east)) for each in self.flown)

    @property
    def flown(self) -> list[Place]:
        """Where it was in the air, in its mode of the program."""
        return [each for _, mode, each in self.track if mode == EXTERNAL and each[2] < 0.0]

    @property
    def touchdown(self) -> float:
        """When it landed, in s."""
        return next(time for time, _, (_, _, down) in reversed(self.track) if down < 0.0)


def example(name: str) -> Any:
    """Import an example."""
    specification = importlib.util.spec_from_file_location(f"example_{name}", FOLDER / f"{name}.py")
    assert specification
    assert specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def flown(main: Coroutine[Any, Any, None], *vehicles: Tracked) -> None:
    """Run a program to its end. Afterwards the vehicles are landed, disarmed, and know nothing of it."""

    async def until_end() -> None:
        await main
        await asyncio.sleep(0.1)

    run(until_end(), *vehicles)
    for vehicle in vehicles:
        world = vehicle.world
        assert (world.is_landed, world.is_armed, world.commander.failsafe.is_active) == (True, False, False)
        assert not world.commander.components.modes


AT_NIGHT = [pytest.param(each, marks=pytest.mark.night) for each in [(), *((name,) for name in DISTURBANCES)]]


@pytest.fixture(params=[tuple(DISTURBANCES), *AT_NIGHT], ids="+".join)
def disturbances(request: pytest.FixtureRequest) -> tuple[str, ...]:
    """All that makes flying hard and, at night, nothing of it and each thing by itself."""
    found: tuple[str, ...] = request.param
    return found


@pytest.fixture
def vehicle(px4_types: Any, disturbances: tuple[str, ...]) -> Tracked:
    return Tracked(px4_types, Options(disturbances=disturbances))


def test_every_example_is_here() -> None:
    assert {path.stem for path in FOLDER.glob("*.py")} == {
        "indoor",
        "inspection",
        "precision_landing",
        "rover",
        "square",
        "survey",
        "triangle",
        "two_vehicles",
        "vtol",
    }


def test_square(vehicle: Tracked, capsys: pytest.CaptureFixture[str]) -> None:
    square = example("square")

    async def main() -> None:
        async with Flight(vehicle, limits=LIMITS) as flight:
            await square.main(flight)

    flown(main(), vehicle)
    assert capsys.readouterr().out.splitlines() == [f"at {north} {east}" for north, east in square.CORNERS]
    assert max(vehicle.nearest(*corner) for corner in square.CORNERS) < 0.5
    heights = [-down for _, _, down in vehicle.flown]
    assert max(heights) - min(heights) < 1.5  # it still climbs a little when the takeoff has ended
    assert vehicle.modes[:5] == [HOLD, TAKEOFF, HOLD, EXTERNAL, LAND]


@pytest.mark.parametrize(
    ("name", "kind", "said"),
    [
        ("triangle", "plane", ["over 200 0", "over 100 170", "over 0 0"]),
        ("rover", "rover", ["20 m north", "15 m east"]),
        pytest.param("rover", "differential", ["20 m north", "15 m east"], marks=pytest.mark.night),
        pytest.param("vtol", "vtol", ["on wings", "there", "hovering"], marks=pytest.mark.night),
        pytest.param("vtol", "tailsitter", ["on wings", "there", "hovering"], marks=pytest.mark.night),
    ],
)
def test_other_vehicles(
    px4_types: Any, name: str, kind: str, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    found = example(name)
    vehicle = Tracked(px4_types, Options(vehicle=kind))

    async def main() -> None:
        async with Flight(vehicle) as flight:
            await found.main(flight)

    flown(main(), vehicle)
    assert capsys.readouterr().out.splitlines() == said
    if name == "triangle":
        assert max(vehicle.nearest(*corner) for corner in found.CORNERS) < 22.0
    if name == "vtol":
        assert vehicle.nearest(*found.PLACE[:2]) < 25.0


def test_survey(vehicle: Tracked, capsys: pytest.CaptureFixture[str]) -> None:
    survey = example("survey")

    async def main() -> None:
        async with Flight(vehicle, limits=LIMITS) as flight:
            await survey.main(flight)

    flown(main(), vehicle)
    photos = ["item 2: photo 1 of the north west", *(f"item 5: photo {each} of the north east" for each in (1, 2))]
    assert capsys.readouterr().out.splitlines() == [*photos, "back"]
    assert max(vehicle.nearest(*corner) for corner in [(12.0, 0.0), (12.0, 12.0), (0.0, 0.0)]) < 2.0
    assert vehicle.modes[:5] == [HOLD, EXTERNAL, TAKEOFF, EXTERNAL, LAND]


def test_indoor(px4_types: Any, disturbances: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    indoor = example("indoor")
    parameters = {"EKF2_EV_CTRL": 15.0, "EKF2_GPS_CTRL": 0.0}
    vehicle = Tracked(px4_types, Options(disturbances=disturbances, parameters=parameters))

    async def main() -> None:
        async with Flight(vehicle, limits=Limits(height=3.0, distance=5.0)) as flight:
            await indoor.main(flight)

    flown(main(), vehicle)
    corners = [f"at {east} {north} {up}" for east, north, up in indoor.CORNERS]
    assert capsys.readouterr().out.splitlines() == ["fused: position, height", *corners]
    assert vehicle.modes[1:] == [TAKEOFF, HOLD, OFFBOARD, HOLD, LAND, HOLD]
    assert not vehicle.world.external.uses_gps


def test_inspection(vehicle: Tracked, capsys: pytest.CaptureFixture[str]) -> None:
    inspection = example("inspection")

    async def main() -> None:
        async with Flight(vehicle, limits=LIMITS) as flight:
            await inspection.main(flight)

    flown(main(), vehicle)
    page = (ROOT / "docs" / "flight_modes.md").read_text(encoding="utf-8")
    assert page.split("```")[1].endswith(f"inspection.py\n{capsys.readouterr().out}")
    east, north = inspection.MAST
    around = [math.hypot(each[0] - north, each[1] - east) for each in vehicle.flown if each[0] > north]
    assert min(around) > inspection.RADIUS - 1.5
    assert max(around) < inspection.RADIUS + 1.5
    angles = [math.tau * view / inspection.VIEWS for view in range(inspection.VIEWS)]
    views = [(north + inspection.RADIUS * math.cos(each), east + inspection.RADIUS * math.sin(each)) for each in angles]
    assert max(vehicle.nearest(*view) for view in views) < 0.6
    assert vehicle.modes[:5] == [HOLD, EXTERNAL, TAKEOFF, EXTERNAL, RETURN]


def test_inspection_is_refused_with_little_charge() -> None:
    inspection = example("inspection")
    battery = SimpleNamespace(latest=None)
    part = inspection.Inspection(SimpleNamespace(feeds={"battery_status": battery}))
    assert part.problems() == []
    battery.latest = SimpleNamespace(remaining=0.2)
    assert [each.event for each in part.problems()] == ["inspection_low_battery"]


@by_day("velocity", [(0.5, 0.3), (-0.6, 0.8), (0.0, 0.0)], 3)
def test_precision_landing(
    vehicle: Tracked, disturbances: tuple[str, ...], velocity: tuple[float, float], record_property: Any
) -> None:
    landing = example("precision_landing")
    targets = []

    async def main() -> None:
        targets.append(landing.Target(velocity=velocity))
        async with Flight(vehicle, limits=LIMITS) as flight:
            await landing.main(flight, targets[0])

    flown(main(), vehicle)
    seconds = vehicle.touchdown - targets[0].start
    last = [place + speed * seconds for place, speed in zip(targets[0].place, velocity, strict=True)]
    away = math.dist(last, vehicle.world.flight.position[:2])
    record_property("away", away)
    assert away < (1.0 if WIND in disturbances else 0.3)
    assert vehicle.modes[:5] == [HOLD, EXTERNAL, TAKEOFF, EXTERNAL, LAND]


def test_two_vehicles(px4_types: Any, disturbances: tuple[str, ...]) -> None:
    two = example("two_vehicles")
    leader = Tracked(px4_types, Options(disturbances=disturbances))
    follower = Tracked(px4_types, Options(key=2, disturbances=disturbances))

    async def main() -> None:
        async with Flight(leader) as first, Flight(follower) as second:
            await two.main(first, second)

    flown(main(), leader, follower)
    for north, east in two.CORNERS:
        assert leader.nearest(north, east) < 0.5
        assert follower.nearest(north, east) < 1.0
    pairs = zip(leader.track, follower.track, strict=False)
    both = [(one[2], other[2]) for one, other in pairs if one[1] == other[1] == EXTERNAL and other[2][2] < 0.0]
    apart = max(math.dist(one[:2], other[:2]) for one, other in both)
    assert apart < (2.0 if WIND in disturbances else 1.5)
    assert all(1.5 < one[2] - other[2] < 4.5 for one, other in both)


def test_the_examples_are_listed_on_the_pages() -> None:
    listed = "".join(
        (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8").partition("## Examples")[2]
        for name in ("flight", "flight_vehicles")
    )
    assert [path.name for path in FOLDER.glob("*.py") if f"../examples/flight/{path.name}" not in listed] == []


def test_no_example_is_long() -> None:
    longest: dict[Path, int] = {path: len(path.read_text().splitlines()) for path in FOLDER.glob("*.py")}
    assert max(longest.values()) < 130
