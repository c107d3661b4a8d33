"""Enums in message classes: values, flags, assignment, pickling, and that they are made on first access."""

from __future__ import annotations

import dataclasses
import enum
import pickle
import subprocess
import sys
from typing import Any

import pytest

from support.repository import ROOT


def enums_of(cls: Any) -> dict[str, Any]:
    """Return the enums of a message by field."""
    found = {field.name: cls.__msg__.enum(field.name) for field in cls.__msg__.fields}
    return {name: each for name, each in found.items() if each is not None}


def test_members_are_constants(px4_types: Any) -> None:
    """The members have the values of their constants, or are the bits with these numbers."""
    for cls in (getattr(px4_types.msg, name) for name in px4_types.msg.__all__):
        constants = {constant.name: constant.value for constant in cls.__msg__.constants}
        for made in enums_of(cls).values():
            assert made.__qualname__ == f"{cls.__name__}.{made.__name__}"
            for name, member in made.__members__.items():
                values = [constants[name]] if name in constants else []
                values += [value for one, value in constants.items() if one.endswith(f"_{name}")]
                assert any(member in (value, 1 << max(0, value)) for value in values), (cls, name)


def test_values_and_flags(px4_types: Any) -> None:
    state = px4_types.VehicleStatus.NavigationState
    assert issubclass(state, enum.IntEnum)
    assert state.OFFBOARD == px4_types.VehicleStatus.NAVIGATION_STATE_OFFBOARD == 14
    assert state(14) is state.OFFBOARD
    assert "MAX" not in state.__members__  # the number of states
    assert issubclass(px4_types.EscReport.Failure, enum.IntFlag)
    assert px4_types.EscReport.Failure.OVER_RPM == 1 << px4_types.EscReport.FAILURE_OVER_RPM
    assert px4_types.VehicleCommand.VehicleRoi.LOCATION == px4_types.VehicleCommand.VEHICLE_ROI_LOCATION
    assert state.__doc__ == "Values of `nav_state_user_intention`, `nav_state`, `nav_state_display`."


def test_members_encode_as_integers_do(px4_types: Any) -> None:
    status, battery = px4_types.VehicleStatus, px4_types.BatteryStatus
    orbit = status.NavigationState.ORBIT
    assert status(nav_state=orbit).encode() == status(nav_state=int(orbit)).encode()
    decoded = status.decode(status(nav_state=orbit).encode())
    assert type(decoded.nav_state) is int
    assert decoded.nav_state == orbit
    faults = battery.Fault.SPIKES | battery.Fault.CELL_FAIL
    assert battery.Fault(battery.decode(battery(faults=faults).encode()).faults) is faults


def test_enums_are_the_same_object_everywhere(px4_types: Any) -> None:
    status = px4_types.VehicleStatus
    derived: Any = type("Derived", (status,), {"__slots__": ()})
    assert derived.NavigationState is status.NavigationState
    assert status().NavigationState is status.NavigationState
    assert status.lazy(status().encode()).NavigationState is status.NavigationState
    orbit = status.NavigationState.ORBIT
    assert pickle.loads(pickle.dumps(orbit)) is orbit  # noqa: S301 - our own bytes


def test_metadata_is_that_of_the_description(px4_types: Any) -> None:
    info = px4_types.BatteryStatus.__msg__
    found = {field.name: field.metadata for field in dataclasses.fields(px4_types.BatteryStatus)}
    assert found["voltage_v"]["unit"] == info.field("voltage_v").unit == "V"
    assert found["warning"]["enum"] == "WARNING STATE"
    assert all(
        field.description == found[field.name].get("description", "")
        for field in px4_types.BatteryStatus.__msg__.fields
    )


def test_an_unknown_field_has_no_enum(px4_types: Any) -> None:
    with pytest.raises(KeyError, match="did you mean 'nav_state'"):
        px4_types.VehicleStatus.__msg__.enum("navstate")
    assert px4_types.VehicleStatus.__msg__.enum("timestamp") is None


def test_nothing_is_made_before_it_is_needed() -> None:
    start = f"import sys; sys.path.insert(0, {str(ROOT / 'generated')!r}); from px4_types import VehicleStatus"
    code = f"{start}; assert 'enum' not in sys.modules; print(VehicleStatus.HilState.ON.name)"
    command = [sys.executable, "-I", "-S", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "ON\n", done.stderr
