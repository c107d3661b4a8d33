"""Tests of the simulated commander: captured flights of PX4 v1.18 are replayed against it, 35 of a multicopter and six
of a plane, a VTOL and a rover.

It is told what programs told the captured one, at the same times. It must give the same answers in the same order, and
show the same changes in the same order, each within 0.3 s. PX4 sends VehicleStatus when its state changes and twice a
second, but at most each 0.2 s: a change lies between the message that shows it and the one before. So our change must
not be more than 0.3 s before the earlier one, nor more than 0.3 s after the later one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from msggen.sim.commander.components import Overrides, Registration
from msggen.sim.commander.requirements import OF_PX4
from msggen.sim.commander.rules import V1_18, Rules
from support import flight_captures
from support.examples import by_day
from support.flight_comparison import (
    SOURCES,
    answers_of,
    different_answers,
    different_values,
    first_of_each_row,
    shown,
)
from support.flight_replay import PARAMETERS, OfExecutor, Replay, Silence, Told, vehicle_of
from support.repository import shared

OTHERS = [name for name in flight_captures.names() if vehicle_of(name) != "multicopter"]
MULTICOPTERS = [name for name in flight_captures.names() if name not in OTHERS]
PYTHON = Registration("Python", check=True, mode=True, executor=True)

TOLD_IN_CUTS: Mapping[str, Sequence[Told]] = {
    "killed-goto-0": [PYTHON],
    "noreply": [Silence(16, 18.5), Silence(20.5, 23)],
    "overrides-battery": [OfExecutor(1, Overrides(defers=True, defer_seconds=10))],
    "overrides-disarm": [OfExecutor(1, Overrides(keeps_armed=True))],
    "register-armed-0": [Registration("Other", check=True, mode=True)],
}
"""What programs told the commander while the vehicle climbed, which was cut out of most captures. The commands that the
state after a cut shows (arm, take off, fly the own mode) are given by `Replay`."""

LEFT_OUT = {
    "samples of sensors, estimates and setpoints": "the commander gets `Senses` in their place",
    "the order of answers in one datagram": "it is that of topics",
    "request_id of registrations": "it is random",
    "request_id of requests to checks, and how many there are": "their phase differs after a cut; their masks count",
    "not_user_selectable": "the reply repeats it",
    "ModeCompleted after the first one in a row": "it is repeated by time",
    "ModeCompleted of the modes of programs": "PX4 repeats what they sent",
    "acks of INJECT_FAILURE and DO_VTOL_TRANSITION": "the simulator answers, and the controller of a VTOL",
    "answers and masks older than the state of the vehicle": "a new session sends them again",
    "masks and pre_flight_checks_pass that last less than 0.21 s": "PX4 looks each 0.1 s, in another phase",
    "our values that no message could show": "they last less than 0.21 s, or lie between two messages of 2 Hz",
    "mode_req_wind_and_flight_time_compliance": "no mode of a program has it, and the simulated vehicle has no wind",
    "what happens in a cut": "there is nothing to compare with: the climb after takeoff in most captures",
}
"""What is not compared, and why."""


def parameters_of(name: str) -> dict[str, float]:
    """Return the parameters with which a flight was captured."""
    changes: dict[str, float] = {"COM_MODE_ARM_CHK": 0} if name.endswith("-0") else {}
    if name == "overrides-battery":
        changes["COM_LOW_BAT_ACT"] = 3
    return {**PARAMETERS, **changes}


def replayed(name: str, package: Any, changes: Mapping[str, float] = {}, rules: Rules = V1_18) -> Replay:
    """Return the replay of a flight."""
    replay = Replay(package, name, {**parameters_of(name), **changes}, TOLD_IN_CUTS.get(name, ()), rules)
    replay.run()
    return replay


def check(name: str, package: Any) -> None:
    replay = replayed(name, package)
    assert different_answers(replay) == []
    assert different_values(replay) == []


@by_day("name", MULTICOPTERS, 2)
def test_the_commander_does_what_px4_did(name: str, px4_types: Any) -> None:
    check(name, px4_types)


@pytest.mark.night  # by day, whole vehicles fly these: test_sim_captures.py
@pytest.mark.parametrize("name", OTHERS)
def test_the_commander_of_another_vehicle_does_what_px4_did(name: str, px4_types: Any) -> None:
    check(name, px4_types)


def test_every_flight_is_there_and_much_of_it_is_compared(px4_types: Any) -> None:
    flights = [flight_captures.Captured(px4_types, name) for name in flight_captures.names()]
    assert len(flights) == 41
    assert Counter(each.topic for flight in flights for each in first_of_each_row(answers_of(flight.samples))) == {
        "vehicle_command_ack": 174,
        "register_ext_component_reply": 110,
        "setpoint_config_reply": 155,
        "mode_completed": 33,
        "config_overrides_confirm": 6,
    }
    changes = {name: sum(len(shown(source, each)) - 1 for each in flights) for name, source in SOURCES.items()}
    assert {name: number for name, number in changes.items() if name not in OF_PX4} == {
        "status": 209,
        "vehicle": 11,
        "ready": 48,
        "selectable": 78,
        "registrations": 46,
        "controls": 162,
    }
    assert {name: number for name, number in changes.items() if name in OF_PX4 and number} == {
        **dict.fromkeys(("angular_velocity", "attitude"), 102),
        "local_alt": 101,
        "local_position": 107,
        "global_position": 11,
        **dict.fromkeys(("local_position_relaxed", "global_position_relaxed"), 5),
        **dict.fromkeys(("home_position", "prevent_arming"), 6),
        "other": 119,
    }


@pytest.mark.parametrize(
    ("name", "rules"),
    [
        ("killed-att", V1_18._replace(misses=3)),
        ("noreply", V1_18._replace(misses=5)),
        ("register-silent", V1_18._replace(first_misses=9)),
        ("register-armed-0", V1_18._replace(always_registers=True)),
        ("limits", V1_18._replace(api_version=1)),
        ("vtol-ground", V1_18._replace(takes_both_of_vtol=True)),
    ],
)
def test_other_rules_would_not_do(name: str, rules: Rules, px4_types: Any) -> None:
    replay = replayed(name, px4_types, rules=rules)
    assert different_answers(replay) + different_values(replay)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("overrides-rc", {"COM_FAIL_ACT_T": 4}),
        ("overrides-battery", {"COM_LOW_BAT_ACT": 0}),
        ("killed-goto-0", {"COM_DISARM_LAND": 3}),
        ("no-takeoff", {"COM_DISARM_PRFLT": 9}),
        ("killed-takeoff-0", {"COM_MODE_ARM_CHK": 1}),
        ("killed-takeoff", {"COM_MODE_ARM_CHK": 0}),
    ],
)
def test_other_parameters_would_not_do(name: str, parameters: dict[str, float], px4_types: Any) -> None:
    replay = replayed(name, px4_types, parameters)
    assert different_answers(replay) + different_values(replay)


@pytest.mark.night  # it can change with the files only
def test_the_flights_are_those_of_the_whole_captures() -> None:
    whole = flight_captures.whole(shared("oracles/flight"))
    assert [name for name in flight_captures.names() if flight_captures.load(name) != whole[name]] == []
