"""Vehicle commands: their parameters by name, the checks of values, and the commands of real firmware."""

from __future__ import annotations

import importlib
import math
import pickle
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from msggen import read
from msggen.base.location import Location
from msggen.definitions.model import Comment, Constant, FieldType
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.parameters import parameters
from msggen.generate.python.package import render_package
from support.examples import by_day
from support.repository import shared


@pytest.fixture(scope="module")
def commands(px4_types: Any) -> Any:
    return importlib.import_module(f"{px4_types.__name__}.commands")


def every(module: Any) -> dict[str, Any]:
    """Return the commands of the module by name."""
    from_base = {name: value for name, value in vars(module).items() if isinstance(value, module.Command)}
    return {name.strip("_"): value for name, value in from_base.items()}


def test_every_command_is_there(px4_types: Any, commands: Any) -> None:
    constants = {
        constant.name.removeprefix("VEHICLE_CMD_"): constant.value
        for constant in px4_types.VehicleCommand.__msg__.constants
        if constant.name.startswith("VEHICLE_CMD_")
    }
    assert {name: int(command) for name, command in every(commands).items()} == constants


def test_a_command_makes_a_message(px4_types: Any, commands: Any) -> None:
    message = commands.NAV_TAKEOFF(altitude=488.5, latitude=47.4, target_system=1)
    assert isinstance(message, px4_types.VehicleCommand)
    assert message.command == px4_types.VehicleCommand.VEHICLE_CMD_NAV_TAKEOFF
    assert (message.param5, message.param7, message.target_system) == (47.4, 488.5, 1)
    assert all(math.isnan(value) for value in (message.param1, message.param4, message.param6))
    assert px4_types.VehicleCommand.decode(message.encode()) == message


def test_parameters_have_units_ranges_and_enums(px4_types: Any, commands: Any) -> None:
    heading, latitude, longitude, altitude = commands.NAV_TAKEOFF.params
    assert (heading.number, heading.name, heading.unit, heading.range) == (4, "heading", "deg", "0,360")
    assert [each.name for each in (latitude, longitude, altitude)] == ["latitude", "longitude", "altitude"]
    assert commands.DO_SET_ROI.params[0].enum is px4_types.VehicleCommand.VehicleRoi


def test_values_of_every_command_stand_in_their_place(commands: Any) -> None:
    for command in every(commands).values():
        values = {each.name: 0.0 for each in command.params if each.enum is None and not each.range}
        message = command(**values)
        given = {f"param{each.number}" for each in command.params if each.name in values}
        for number in range(1, 8):
            assert math.isnan(getattr(message, f"param{number}")) == (f"param{number}" not in given)


def test_parameters_can_be_given_by_number(commands: Any) -> None:
    assert commands.NAV_PRECLAND(param3=2.0).param3 == 2.0
    assert commands.COMPONENT_ARM_DISARM(param1=1).param1 == 1


@pytest.mark.parametrize(
    ("command", "values", "text"),
    [
        ("NAV_TAKEOFF", {"heading": 400.0}, "NAV_TAKEOFF: heading, param4: expected 0 to 360, got 400.0"),
        ("NAV_TAKEOFF", {"altitude": "10"}, "NAV_TAKEOFF: altitude, param7: expected a number, got '10'"),
        ("NAV_TAKEOFF", {"param4": 400.0}, "NAV_TAKEOFF: heading, param4: expected 0 to 360, got 400.0"),
        ("NAV_TAKEOFF", {"param1": "up"}, "NAV_TAKEOFF: param1: expected a number, got 'up'"),
        ("NAV_TAKEOFF", {"altitude": np.zeros(2)}, "NAV_TAKEOFF: altitude, param7: expected a number, got a"),
        ("NAV_TAKEOFF", {"altitude": 10**400}, "NAV_TAKEOFF: altitude, param7: expected a number, got 1000"),
        ("DO_SET_ROI", {"vehicle_roi": 77}, "DO_SET_ROI: .*: expected a VehicleRoi, one of NONE, .*, got 77"),
        ("DO_ORBIT", {"param3": 2.5}, "DO_ORBIT: .*, param3: expected an OrbitYawBehaviour, one of .*, got 2.5"),
    ],
)
def test_a_value_that_a_parameter_cannot_have_is_an_error(
    command: str, values: dict[str, Any], text: str, commands: Any
) -> None:
    made = getattr(commands, command)
    if "vehicle_roi" in values:
        values = {made.params[0].name: 77}
    with pytest.raises(commands.CommandError, match=text):
        made(**values)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"altitud": 10.0}, "NAV_TAKEOFF has no parameter 'altitud', did you mean 'altitude'?"),
        ({"target_sys": 1}, "NAV_TAKEOFF has no parameter 'target_sys', did you mean 'target_system'?"),
        (
            {"up": 1.0},
            "NAV_TAKEOFF has no parameter 'up': there are 'heading', 'latitude', 'longitude', 'altitude'",
        ),
        (
            {"command": 3},
            "NAV_TAKEOFF has no parameter 'command': there are 'heading', 'latitude', 'longitude', 'altitude'",
        ),
        ({"heading": 10.0, "param4": 10.0}, "NAV_TAKEOFF: heading is param4: give one of them"),
    ],
)
def test_a_wrong_name_is_an_error(values: dict[str, Any], text: str, commands: Any) -> None:
    with pytest.raises(TypeError) as caught:
        commands.NAV_TAKEOFF(**values)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("NAV_TAKEOF", ", did you mean 'NAV_TAKEOFF'?"),
        ("VEHICLE_CMD_NAV_TAKEOFF", ", did you mean 'NAV_TAKEOFF'?"),
        ("ARM", ": there are 'COMPONENT_ARM_DISARM', 'ARM_AUTHORIZATION_REQUEST'"),
        ("disarm", ", did you mean 'COMPONENT_ARM_DISARM'?"),
        ("VEHICLE_CMD_LAUNCH", ", did you mean 'NAV_RETURN_TO_LAUNCH'?"),
        ("ZZZ", ": dir(commands) lists them"),
    ],
)
def test_an_unknown_command_names_the_nearest(name: str, end: str, commands: Any) -> None:
    with pytest.raises(AttributeError) as caught:
        getattr(commands, name)
    assert str(caught.value) == f"no command '{name}'{end}"


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int16, np.uint8, int, Fraction])
def test_numbers_of_any_kind_are_values(commands: Any, kind: Any) -> None:
    message = commands.DO_ORBIT(radius=kind(5), orbit_yaw_behaviour=kind(2))
    assert (message.param1, message.param3) == (5.0, 2.0)
    assert type(message.param1) is float


@pytest.mark.parametrize(
    ("text", "values"), [("1,0", [0.0, 1.0, 7.0]), ("low, high", [-1.0]), ("0, 2pi", [6.28]), ("1,", [1.0, 9e9])]
)
def test_ranges_are_read_as_those_of_fields(px4_types: Any, text: str, values: list[float]) -> None:
    """A range that is upside down, as one of the firmware's is, or that is not understood, limits nothing."""
    parameters_module = importlib.import_module(f"{px4_types.__name__}.parameters")
    parameter = parameters_module.Parameter(1, "a", range=text)
    assert [parameter.check(value) for value in values] == values
    if "pi" in text:
        with pytest.raises(parameters_module.CommandError, match="expected 0 to 2pi, got 6"):
            parameter.check(6.29)


def test_commands_are_immutable_values(commands: Any) -> None:
    takeoff = commands.NAV_TAKEOFF
    assert pickle.loads(pickle.dumps(takeoff)) == takeoff  # noqa: S301 - our own bytes
    with pytest.raises(AttributeError, match="read-only"):
        takeoff.value = 3


def names(text: str) -> list[tuple[int, str]]:
    """Return the parameters in the comment of a constant."""
    type_ = FieldType("uint16")
    constant = Constant("VEHICLE_CMD_A", type_, 1, Location("A.msg"), 1, Comment(text))
    return [(parameter.number, parameter.name) for parameter in parameters(constant)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Text.", []),
        ("Text.|Unused|[deg] Latitude (WGS-84)|Altitude AMSL|", [(2, "latitude"), (3, "altitude")]),
        ("|The first item of a mission|Its last-flown item", [(1, "first_item"), (2, "last_flown_item")]),
        ("|[@enum VEHICLE_ROI]|[@enum ROI_X] 0 means none", [(1, "vehicle_roi"), (2, "roi_x")]),
        ("|0: off, 1: on|Übung", [(1, "param1"), (2, "param2")]),
        ("|Offset|Offset", [(1, "offset"), (2, "offset_2")]),
        ("|class|a", [(1, "param1"), (2, "param2")]),
        ("|||Reserved (default:0)|Empty|NaN to ignore|6|7|8|9", [(5, "nan"), (6, "param6"), (7, "param7")]),
    ],
)
def test_names_of_parameters(text: str, expected: list[tuple[int, str]]) -> None:
    assert names(text) == expected


def test_tags_of_parameters_stay_with_them() -> None:
    text = "uint64 timestamp\nuint16 A = 1 # [@range 0, 1] Own. |[@range 2, 3] One|[@range 4, 5] Two\n"
    (constant,) = parse_message(text, "A.msg", "A", "p")[0].constants
    assert constant.comment.tag("range") == "0, 1"
    assert [parameter.comment.tag("range") for parameter in parameters(constant)] == ["2, 3", "4, 5"]


@by_day("tree", ["v1.14", "v1.16", "v1.18", "main-2026-03"], 4)
def test_every_firmware_has_commands(tree: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = f"commands_{tree.replace('.', '_').replace('-', '_')}"
    for name, text in render_package(read(shared(f"firmware/{tree}")), package).items():
        path = tmp_path / package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    module = importlib.import_module(f"{package}.commands")
    assert len(every(module)) > 90
    assert module.NAV_TAKEOFF(param7=3.0).param7 == 3.0
