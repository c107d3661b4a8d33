"""Whole simulated planes, VTOLs and rovers beside captured flights of PX4 v1.18: each flies a capture again.

It is told what programs told the captured one, at the same times: it must give the same answers in the same order, go
through the same states, fly the same way, and publish its topics in the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import pytest

from msggen.messages.commands import VTOL_TRANSITION
from support import captured_paths, flight_comparison, published, published_flights
from support.captured_paths import farthest
from support.flight_comparison import different_answers, different_values
from support.flown_captures import ALL_SOURCES, FlownCapture
from support.published_flights import FLIGHTS, Flying
from support.repository import ROOT, shared

REAL = published_flights.load()
FAR: Mapping[str, int] = {"vtol-flight": 700_000}
"""How far apart in us answers and states may be, if not 0.3 s: the last metre of a takeoff takes longer."""
OF_OTHERS: Mapping[str, Collection[int]] = {"vtol-ground": {VTOL_TRANSITION}}
"""The commands whose answers are left out: this one is given earlier, see `EARLIER` of support.flown_captures."""


class Phase(NamedTuple):
    """A part of a flight, and how near to the captured vehicle the simulated one has to be in it."""

    begin: float
    end: float
    """In s."""
    near: Mapping[str, float]
    """By quantities: degrees, m and m/s."""


PHASES: Mapping[tuple[str, str], Phase] = {
    ("fw-flight", "takeoff"): Phase(11.0, 16.3, {"course": 3, "altitude": 2, "speed": 2.5}),
    ("fw-flight", "hold"): Phase(27.2, 28.7, {"course": 8, "altitude": 1, "speed": 1}),
    ("fw-flight", "no setpoint yet"): Phase(29.8, 34.7, {"course": 5, "altitude": 1.5, "speed": 1}),
    ("fw-flight", "turn by course"): Phase(34.8, 38.0, {"course": 15, "speed": 1}),
    ("fw-flight", "climb to an altitude"): Phase(38.0, 53.0, {"course": 4, "altitude": 5, "speed": 1}),
    ("fw-flight", "at the altitude"): Phase(54.5, 60.7, {"course": 3, "altitude": 4, "speed": 1}),
    ("fw-flight", "lateral acceleration, height rate"): Phase(77.1, 78.7, {"roll": 3, "climb": 0.5}),
    ("fw-flight", "turn and descend"): Phase(79.0, 82.0, {"course": 40, "altitude": 5, "speed": 3}),
    ("fw-flight", "descend"): Phase(82.5, 86.7, {"course": 5, "altitude": 5, "speed": 2.5}),
    ("fw-flight", "trajectory setpoints"): Phase(94.9, 100.7, {"course": 3, "altitude": 1, "speed": 0.5}),
    ("fw-flight", "turn at the altitude"): Phase(100.8, 108.7, {"course": 20, "altitude": 2, "speed": 1.5}),
    ("fw-flight", "setpoints in Hold"): Phase(108.8, 112.0, {"course": 5, "altitude": 2, "speed": 1}),
    ("fw-flight", "turn back"): Phase(117.9, 120.7, {"course": 8, "altitude": 2, "speed": 1.5}),
    ("fw-flight", "return"): Phase(122.5, 128.0, {"climb": 1, "speed": 1.5}),
    ("vtol-flight", "takeoff"): Phase(11.1, 25.4, {"north": 1, "east": 1.5, "altitude": 3}),
    ("vtol-flight", "hover"): Phase(26.2, 30.1, {"north": 1, "east": 1, "altitude": 1}),
    ("vtol-flight", "to forward flight"): Phase(30.2, 32.4, {"speed": 1.5, "altitude": 1}),
    ("vtol-flight", "turn by course"): Phase(33.3, 37.0, {"course": 10, "speed": 2.2, "altitude": 3}),
    ("vtol-flight", "climb to an altitude"): Phase(37.0, 47.0, {"course": 4, "speed": 1.2, "altitude": 4}),
    ("vtol-flight", "at the altitude"): Phase(48.0, 60.2, {"course": 4, "speed": 1, "altitude": 3}),
    ("vtol-flight", "without setpoints"): Phase(60.3, 66.2, {"course": 4, "speed": 1, "altitude": 2}),
    ("vtol-flight", "to hovering"): Phase(66.3, 66.9, {"speed": 1, "altitude": 1.5}),
    ("vtol-flight", "hover again"): Phase(68.2, 72.2, {"north": 1, "east": 1, "altitude": 1.5}),
    ("vtol-flight", "to forward flight again"): Phase(72.3, 75.0, {"speed": 1.5, "height": 1.5}),
    ("vtol-flight", "forward by the old course"): Phase(75.3, 80.3, {"course": 8, "speed": 1.5, "height": 2}),
    ("rover-drive", "to a place"): Phase(9.8, 20.7, {"north": 1, "east": 0.5}),
    ("rover-drive", "speed and attitude"): Phase(22.2, 28.7, {"heading": 20, "speed": 0.6}),
    ("rover-drive", "without setpoints"): Phase(28.8, 32.7, {"heading": 3, "speed": 0.4}),
    ("rover-drive", "throttle beside the old speed"): Phase(32.9, 36.8, {"heading": 3, "speed": 0.4}),
    ("rover-drive", "throttle alone"): Phase(38.3, 40.8, {"heading": 3, "speed": 0.4}),
    ("rover-drive", "speed and rate"): Phase(41.7, 45.8, {"heading": 10, "speed": 0.5}),
    ("rover-drive", "trajectory setpoints"): Phase(46.0, 48.8, {"heading": 15, "speed": 0.8}),
    ("rover-drive", "to another place"): Phase(49.6, 53.8, {"heading": 12, "speed": 0.8}),
    ("rover-drive", "Land"): Phase(53.9, 55.8, {"heading": 5, "speed": 0.6}),
}
"""By the names of flights, and of their phases.

Along a straight line, the simulated vehicle has to be near: what is left is drift. A turn, a transition and a stop last
for a second or two, in which a lag of a few tenths shows as up to 15 degrees or 1 m/s. A plane that turns and descends
is 35 degrees off for a second, because the real one rolls out of the turn before later.
"""


def of_day_or_night(flight: str, *case: str) -> Any:
    """Return a case of a test with a flight: the longest one is for the night, and a VTOL flies as a plane by day."""
    return pytest.param(*case, marks=pytest.mark.night if flight == "fw-flight" else ())


@pytest.fixture(scope="module")
def flown(px4_types: Any) -> Callable[[str], FlownCapture]:
    @cache
    def fly(name: str) -> FlownCapture:
        made = FlownCapture(px4_types, name)
        made.run()
        return made

    return fly


@pytest.mark.parametrize("name", [of_day_or_night(name, name) for name in captured_paths.names()])
def test_a_vehicle_answers_and_changes_its_state_as_px4_did(name: str, flown: Callable[[str], FlownCapture]) -> None:
    made = flown(name)
    far = FAR.get(name, flight_comparison.FAR)
    assert different_answers(made, far, OF_OTHERS.get(name, ())) == []
    assert different_values(made, ALL_SOURCES, far) == []


@pytest.mark.parametrize(("name", "phase"), [of_day_or_night(name, name, phase) for name, phase in PHASES])
def test_a_vehicle_moves_as_px4_did(name: str, phase: str, flown: Callable[[str], FlownCapture]) -> None:
    assert too_far(flown(name), PHASES[name, phase]) == {}


@pytest.mark.night
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("fw-flight", {"FW_AIRSPD_TRIM": 12}),
        ("vtol-flight", {"VT_TRANS_TIMEOUT": 2}),
        ("rover-drive", {"COM_DISARM_LAND": 3}),
    ],
)
def test_a_vehicle_with_other_parameters_would_not_do(name: str, parameters: dict[str, float], px4_types: Any) -> None:
    made = FlownCapture(px4_types, name, parameters)
    made.run()
    assert different_values(made, ALL_SOURCES, FAR.get(name, flight_comparison.FAR)) or not is_near(made, name)


def is_near(made: FlownCapture, name: str) -> bool:
    return not any(too_far(made, phase) for (own, _), phase in PHASES.items() if own == name)


def too_far(made: FlownCapture, phase: Phase) -> dict[str, tuple[float, float]]:
    real = [each for each in made.path.places if phase.begin <= each.time < phase.end]
    found = {quantity: farthest(quantity, real, made.places) for quantity in phase.near}
    return {quantity: apart for quantity, apart in found.items() if apart[0] > phase.near[quantity]}


def test_home_follows_a_rover_that_rolls_on_after_it_was_disarmed(flown: Callable[[str], FlownCapture]) -> None:
    homes = [each.message.x for each in flown("rover-drive").samples if each.topic == "home_position"]
    steps = [after - before for before, after in pairwise(homes[3:])]
    assert homes[:3] == [0.0] * 3, "known, armed, started"
    assert len(steps) == 7, "from 55.9 to 58.9 s"
    assert steps == [pytest.approx(1.0, abs=0.05)] * 7, "the captured ones are 1.00 to 1.05 m"


@pytest.fixture(scope="module")
def own(px4_types: Any, flown: Callable[[str], FlownCapture]) -> Callable[[str], dict[str, Flying]]:
    def find(vehicle: str) -> dict[str, Flying]:
        return published_flights.simulated(px4_types, vehicle, flown(FLIGHTS[vehicle]))

    return cache(find)


@pytest.mark.parametrize("vehicle", [of_day_or_night(name, vehicle) for vehicle, name in FLIGHTS.items()])
def test_the_same_topics_are_published_at_a_rate_on_change_once_or_never(
    vehicle: str, own: Callable[[str], dict[str, Flying]]
) -> None:
    real, ours = REAL[vehicle], own(vehicle)
    different = {name: (each.how, ours[name].how) for name, each in real.items() if each.how != ours[name].how}
    assert different == {}


@pytest.mark.parametrize("vehicle", [of_day_or_night(name, vehicle) for vehicle, name in FLIGHTS.items()])
def test_topics_have_the_rates_of_the_real_vehicle(vehicle: str, own: Callable[[str], dict[str, Flying]]) -> None:
    ours = own(vehicle)
    different = {
        name: (each.rate, ours[name].rate)
        for name, each in REAL[vehicle].items()
        if each.rate is not None and ours[name].rate != pytest.approx(each.rate, rel=0.05, abs=0.3)
    }
    accepted = published_flights.RATES.get(vehicle, {}).keys()
    assert {name: rates for name, rates in different.items() if name not in published.RATES.keys() | accepted} == {}
    assert accepted - different.keys() == set(), "no longer different"


@pytest.mark.parametrize("vehicle", [of_day_or_night(name, vehicle) for vehicle, name in FLIGHTS.items()])
def test_fields_move_and_stand_still_as_those_of_the_real_vehicle(
    vehicle: str, own: Callable[[str], dict[str, Flying]]
) -> None:
    found = published.different_fields(REAL[vehicle], own(vehicle))
    different = {(name, field): kinds for name, field, *kinds in found}
    accepted, of_all = (
        {(name, field) for name, fields in each.items() for field in fields}
        for each in (published_flights.FIELDS[vehicle], published.FIELDS)
    )
    assert {each: kinds for each, kinds in different.items() if each not in accepted | of_all} == {}
    assert accepted - different.keys() == set(), "no longer different"


@pytest.mark.night  # flies all of them
def test_the_page_compares_the_rates(own: Callable[[str], dict[str, Flying]]) -> None:
    page = (ROOT / "tests" / "sim" / "compared.md").read_text(encoding="utf-8")
    table = published_flights.table({vehicle: own(vehicle) for vehicle in FLIGHTS})
    assert table in page, "stale: python -m support.published_flights, in the folder tests"


@pytest.mark.night  # it can change with the files only
@pytest.mark.parametrize("name", captured_paths.names())
def test_the_paths_are_those_of_the_whole_captures(name: str) -> None:
    assert captured_paths.whole(shared("oracles/flight"), name) == captured_paths.load(name)


@pytest.mark.night  # it can change with the files only
def test_the_facts_are_those_of_the_captures(px4_types: Any) -> None:
    assert published_flights.captured(px4_types, shared("oracles/flight")) == REAL
