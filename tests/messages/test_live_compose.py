"""Tests of messages from mappings: against the reference encoder for every definition, and what is refused."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import pytest
import yaml

from msggen.definitions.model import ArrayKind, Catalog, Message
from msggen.definitions.parse.yaml_nodes import read_yaml, value_of
from msggen.messages.compose import ValuesError, compose
from support.reference import serialize
from support.samples import values_by_chance

TEXT = "héé"


def written(catalog: Catalog, message: Message, values: dict[str, Any]) -> dict[str, Any]:
    """Return values as a user writes them, with a text in each `char[N]`, which `values` get too."""
    shown: dict[str, Any] = {}
    for field in message.fields:
        value = values[field.name]
        if field.type.name == "char" and field.type.array is not ArrayKind.SCALAR:
            value = TEXT if field.type.length >= 5 else ""
            values[field.name] = list(value.encode().ljust(field.type.length, b"\0"))
        elif not field.type.is_primitive:
            nested = catalog.nested(message, field.type)
            several = value if isinstance(value, list) else [value]
            found = [written(catalog, nested, each) for each in several]
            value = found if isinstance(value, list) else found[0]
        shown[field.name] = value
    return shown


def test_every_message_is_what_its_values_say(embedded: Catalog, px4_types: Any) -> None:
    """Through YAML, as the command gets them."""
    for message in embedded.messages.values():
        values = values_by_chance(embedded, message, Random(message.name))  # noqa: S311 - the same in every run
        text = yaml.safe_dump(written(embedded, message, values))
        root = read_yaml(text.encode(), "VALUES")
        assert root is not None
        cls = getattr(px4_types, message.name)
        assert compose(cls, value_of(root)) == cls.decode(serialize(embedded, message, values, "little", 1))


def test_fields_without_a_value_are_zero(px4_types: Any) -> None:
    for values in (None, {}, {"timestamp": 0}):
        assert compose(px4_types.VehicleStatus, values) == px4_types.VehicleStatus()


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("VehicleStatus", {"nav_state": "AUTO_LOITER"}, {"nav_state": 4}),
        ("VehicleStatus", {"nav_state": "NAVIGATION_STATE_AUTO_LOITER"}, {"nav_state": 4}),
        ("VehicleCommand", {"command": "NAV_LAND"}, {"command": 21}),
        ("BatteryStatus", {"faults": "DEEP_DISCHARGE | CELL_FAIL"}, {"faults": 5}),
        ("BatteryStatus", {"faults": "CELL_FAIL"}, {"faults": 4}),
        ("VehicleStatus", {"nav_state": 99}, {"nav_state": 99}),
        ("TrajectorySetpoint", {"yawspeed": "1e3"}, {"yawspeed": 1000.0}),
        ("TrajectorySetpoint", {"position": [1, "-inf", 2.5]}, {"position": (1.0, -math.inf, 2.5)}),
        ("DebugKeyValue", {"key": "speed"}, {"key": b"speed\0\0\0\0\0"}),
        ("MessageFormatRequest", {"topic_name": "x" * 50}, {"topic_name": b"x" * 50}),
    ],
)
def test_names_stand_for_numbers(name: str, values: Any, expected: dict[str, Any], px4_types: Any) -> None:
    cls = getattr(px4_types, name)
    assert compose(cls, values) == cls(**expected)


def test_nan_is_written_as_people_write_it(px4_types: Any) -> None:
    for text in ("nan", "NaN", ".nan"):
        root = read_yaml(f"{{yaw: {text}, position: [{text}, 0, 1e-3]}}".encode(), "VALUES")
        assert root is not None
        made = compose(px4_types.TrajectorySetpoint, value_of(root))
        assert math.isnan(made.yaw)
        assert math.isnan(made.position[0])
        assert math.isclose(made.position[2], 0.001, rel_tol=1e-6)


@pytest.mark.parametrize(
    ("name", "values", "problems"),
    [
        ("VehicleStatus", {"nav_stat": 1}, ["VehicleStatus has no field 'nav_stat', did you mean 'nav_state'?"]),
        ("VehicleStatus", {3: 1}, ["VehicleStatus has no field '3'"]),
        ("Wind", [1], ["expected the fields of Wind, such as {beta_innov_var: ...}, got [1]"]),
        ("VehicleStatus", {"nav_state": "LOITR"}, ["nav_state: expected a member of NavigationState, got 'LOITR'*"]),
        (
            "VehicleStatus",
            {"arming_state": "ARMD"},
            ["arming_state: expected a member of ArmingState, got 'ARMD', did you mean 'ARMED'?"],
        ),
        ("VehicleStatus", {"system_id": 256}, ["system_id: expected uint8, 0 to 255, got 256"]),
        ("VehicleStatus", {"system_id": -1}, ["system_id: expected uint8, 0 to 255, got -1"]),
        ("VehicleStatus", {"system_id": 1.5}, ["system_id: expected an integer, got the float 1.5"]),
        ("VehicleStatus", {"system_id": "one"}, ["system_id: expected a uint8, got 'one'"]),
        ("VehicleStatus", {"system_id": None}, ["system_id: expected uint8, 0 to 255, got None"]),
        ("VehicleStatus", {"failsafe": 2.0}, ["failsafe: expected a bool, got 2.0"]),
        ("BatteryStatus", {"faults": "FAULT_SPIKES"}, ["faults: expected a member of Fault, got 'FAULT_SPIKES'*"]),
        ("TrajectorySetpoint", {"yaw": "north"}, ["yaw: expected a float32, got 'north'"]),
        ("TrajectorySetpoint", {"yaw": 1e39}, ["yaw: expected float32, up to 3.4028235677973366e+38, got 1e+39"]),
        ("TrajectorySetpoint", {"position": [1, 2]}, ["position: expected a list of 3 values, got 2"]),
        ("TrajectorySetpoint", {"position": 5}, ["position: expected a list of 3 values, got 5"]),
        ("TrajectorySetpoint", {"position": ["a", "b", 1]}, ["position[0]: expected a float32, got 'a'"]),
        (
            "VehicleOdometry",
            {"position_variance": ["a", 0, 0], "position": [0, "b", 0]},
            ["position_variance[0]: expected a float32, got 'a'", "position[1]: expected a float32, got 'b'"],
        ),
        ("EscStatus", {"esc": [{}] * 11 + [{"esc_rp": 1}]}, ["esc[11]: EscReport has no field 'esc_rp'*"]),
        ("EscStatus", {"esc": [{}] * 11 + [5]}, ["esc[11]: expected the fields of EscReport*"]),
        ("DebugKeyValue", {"key": "x" * 11}, ["key: expected text of up to 10 bytes, got 11"]),
        ("DebugKeyValue", {"key": 5}, ["key: expected text, got 5"]),
        (
            "VehicleStatus",
            {"nav_stat": 1, "arming_state": 500, "system_id": 1, "failsafe": []},
            [
                "VehicleStatus has no field 'nav_stat', did you mean 'nav_state'?",
                "arming_state: expected uint8, 0 to 255, got 500",
                "failsafe: expected a bool, got a list of 0",
            ],
        ),
    ],
)
def test_all_problems_are_told_with_their_paths(name: str, values: Any, problems: list[str], px4_types: Any) -> None:
    with pytest.raises(ValuesError) as raised:
        compose(getattr(px4_types, name), values)
    for found, expected in zip(raised.value.problems, problems, strict=True):
        front, is_start, _ = expected.partition("*")
        assert found.startswith(front) if is_start else found == expected


def test_a_request_nests_a_message(px4_types: Any) -> None:
    made = compose(px4_types.srv.VehicleCommand.Request, {"request": {"command": "NAV_LAND"}})
    assert made.request.command == 21
    with pytest.raises(ValuesError, match="has no field 'command': it has 'request'"):
        compose(px4_types.srv.VehicleCommand.Request, {"command": 21})
