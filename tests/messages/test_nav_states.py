"""Tests of the lists of modes and commands: each release has them as they are here."""

from __future__ import annotations

import re
from typing import Any

import pytest

from msggen.definitions.model import Message
from msggen.flight.states import name_of
from msggen.messages import commands, nav_states, vehicle_types
from msggen.messages.commands import RESULTS
from msggen.messages.nav_states import MODE_CONSTANTS, MODE_NAMES, SELECTABLE, mode_number
from msggen.sources.embedded import EMBEDDED
from msggen.sources.read import read

FREE = re.compile(r"(FREE|UNUSED)\d*|MAX")
COMMAND_NAMES = {
    commands.RETURN: "NAV_RETURN_TO_LAUNCH",
    commands.LAND: "NAV_LAND",
    commands.TAKEOFF: "NAV_TAKEOFF",
    commands.SET_MODE: "DO_SET_MODE",
    commands.SET_HOME: "DO_SET_HOME",
    commands.REPOSITION: "DO_REPOSITION",
    commands.ARM_DISARM: "COMPONENT_ARM_DISARM",
    commands.SET_ORIGIN: "SET_GPS_GLOBAL_ORIGIN",
    commands.SET_NAV_STATE: "SET_NAV_STATE",
}
"""The constants of VehicleCommand, without VEHICLE_CMD_, by number."""


def messages_of(release: str) -> dict[str, Message]:
    return {each.name: each for each in read(release=release).messages.values()}


@pytest.fixture(scope="module", params=EMBEDDED)
def messages(request: pytest.FixtureRequest) -> Any:
    """The messages of a release by name."""
    return messages_of(request.param)


def constants(message: Message, prefix: str) -> dict[Any, str]:
    return {each.value: each.name.removeprefix(prefix) for each in message.constants if each.name.startswith(prefix)}


def test_every_mode_of_a_release_has_a_name(messages: Any) -> None:
    found = constants(messages["VehicleStatus"], "NAVIGATION_STATE_")
    named = {mode: name for mode, name in found.items() if not FREE.fullmatch(name)}
    assert named == {mode: MODE_CONSTANTS[mode] for mode in named}
    assert not [mode for mode in named if name_of(mode).isdecimal()]


def test_vehicles_are_disarmed_and_armed_as_in_a_release(messages: Any) -> None:
    found = constants(messages["VehicleStatus"], "ARMING_STATE_")
    assert (found[nav_states.DISARMED], found[nav_states.ARMED]) == ("DISARMED", "ARMED")


def test_the_types_of_vehicles_are_those_of_a_release(messages: Any) -> None:
    found = constants(messages["VehicleStatus"], "VEHICLE_TYPE_")
    named = (vehicle_types.ROTARY_WING, vehicle_types.FIXED_WING, vehicle_types.ROVER)
    assert [found[number] for number in named] == ["ROTARY_WING", "FIXED_WING", "ROVER"]
    assert found.keys() <= vehicle_types.ALL, "0 is unknown in v1.15"
    states = constants(messages["VtolVehicleStatus"], "VEHICLE_VTOL_STATE_")
    assert [states[each] for each in vehicle_types.VtolState] == ["TRANSITION_TO_FW", "TRANSITION_TO_MC", "MC", "FW"]


def test_the_newest_release_has_every_mode_and_command() -> None:
    messages = messages_of(EMBEDDED[0])
    assert MODE_CONSTANTS.keys() <= constants(messages["VehicleStatus"], "NAVIGATION_STATE_").keys()
    assert COMMAND_NAMES.keys() <= constants(messages["VehicleCommand"], "VEHICLE_CMD_").keys()


def test_commands_and_results_have_their_numbers_in_a_release(messages: Any) -> None:
    found = constants(messages["VehicleCommand"], "VEHICLE_CMD_")
    assert {name: number for number, name in found.items() if name in COMMAND_NAMES.values()}.items() <= {
        name: number for number, name in COMMAND_NAMES.items()
    }.items()
    if "VehicleCommandAck" in messages:
        results = constants(messages["VehicleCommandAck"], "VEHICLE_CMD_RESULT_")
        assert {number: text.upper().replace(" ", "_") for number, text in RESULTS.items()} == results
    executors = constants(messages["VehicleCommand"], "COMPONENT_MODE_EXECUTOR_START")
    assert executors.keys() <= {commands.EXECUTOR}


def test_a_mode_is_found_by_each_of_its_names() -> None:
    for mode, name in MODE_NAMES.items():
        constant = MODE_CONSTANTS[mode]
        for text in (
            name,
            name.title(),
            name.replace(" ", "-"),
            constant,
            constant.lower(),
            f"NAVIGATION_STATE_{constant}",
        ):
            assert mode_number(text) == mode
    assert [mode_number(text) for text in ("rtl", "loiter", "orbit", "precland", "", "x")] == [5, 4, 21, 20, None, None]
    assert "termination" not in SELECTABLE
    assert SELECTABLE["orbit"] == 21
