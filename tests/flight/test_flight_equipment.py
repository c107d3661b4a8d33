"""Tests of telemetry that not every vehicle has: sticks, airspeed, wind, a VTOL; and of a mode that uses sticks."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight import TRAJECTORY, Flight, Mode, NoAnswerError, RefusedError, Requirement
from msggen.flight.errors import UnsupportedError
from msggen.flight.telemetry import (
    Airspeed,
    VehicleKind,
    Vtol,
    airspeed_of,
    kind_of,
    sticks_of,
    vtol_of,
    vtol_of_status,
)
from msggen.sim import Options, values
from support.flown import EXTERNAL, Flown, flying, flying_each

HOLD = 4
PARTS = Options(parts=("airspeed", "receiver", "vtol"))
STICKS: Mapping[str, Any] = {
    "valid": True,
    "data_source": 2,
    "sticks_moving": True,
    "flaps": math.nan,
    "roll": 0.25,
    "pitch": 0.5,
    "yaw": -0.5,
    "throttle": -1.0,
    **{f"aux{place}": place / 8 if place < 4 else math.nan for place in range(1, 7)},
}
SENSED: Mapping[str, Mapping[str, Any]] = {
    "ManualControlSetpoint": STICKS,
    "AirspeedValidated": {
        "indicated_airspeed_m_s": 14.0,
        "calibrated_airspeed_m_s": 15.0,
        "true_airspeed_m_s": 16.0,
        "airspeed_source": 1,
        "selected_airspeed_index": 1,
    },
    "VtolVehicleStatus": {"vehicle_vtol_state": 1, "fixed_wing_system_failure": True},
}


def told(found: Mapping[str, Any]) -> Callable[[Any], Mapping[str, Any]]:
    """Return a function that gives these values of any vehicle."""
    return lambda _: found


@pytest.fixture
def sensed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let vehicles publish these values."""
    for name, found in SENSED.items():
        monkeypatch.setitem(values.VALUES, name, told(found))


def has(types: Any, topic: str) -> bool:
    return topic in {each.uorb_topic for each in types.topics.ENDPOINTS}


@pytest.mark.usefixtures("sensed")
@flying_each(PARTS)
async def test_values_are_those_of_the_vehicle_and_end_with_its_messages(
    flight: Flight, vehicle: Flown, types: Any
) -> None:
    """ManualControlInput, OdometryAirspeed, VtolStatus: 0.5 s after the last message they are not valid any more."""
    told = flight.telemetry
    sticks, airspeed, vtol = await told.sticks(), await told.airspeed(), await told.vtol()
    assert (sticks.roll, sticks.pitch, sticks.yaw, sticks.throttle) == (0.25, 0.5, -0.5, -1.0)
    assert (sticks.aux[:3], sticks.source, sticks.are_moving) == ((0.125, 0.25, 0.375), 2, True)
    assert all(map(math.isnan, (sticks.flaps, *sticks.aux[3:])))
    assert airspeed[:4] == (14.0, 15.0, 16.0, 1)
    assert all(each.is_valid and each.age < 0.5 for each in (sticks, airspeed))
    if has(types, "vtol_vehicle_status"):
        assert (vtol[:2], vtol.is_valid) == (("to fixed wing", True), True)
    vehicle.loss = 1.0
    await asyncio.sleep(0.6)
    assert not (await told.sticks()).is_valid
    assert not (await told.airspeed()).is_valid
    assert (await told.vehicle()).is_valid
    await asyncio.sleep(2.6)
    assert not (await told.vtol()).is_valid
    assert not (await told.vehicle()).is_valid


@flying_each(PARTS)
async def test_the_wind_is_told_from_v1_17_on(flight: Flight, types: Any) -> None:
    if not has(types, "wind"):
        with pytest.raises(UnsupportedError, match=r"does not bridge /fmu/out/wind.* PX4 v1.17 and later have it"):
            await flight.telemetry.wind()
        return
    wind = await flight.telemetry.wind()
    assert (wind.north, wind.east) == pytest.approx((1.5, -0.8))
    assert wind.is_valid


@flying_each()
async def test_a_multicopter_has_none_of_it(flight: Flight, vehicle: Flown, types: Any) -> None:
    told, begin = flight.telemetry, vehicle.time
    with pytest.raises(NoAnswerError, match=r"airspeed_validated within 1 s: PX4 publishes it on fixed-wing aircr"):
        await told.airspeed()
    assert vehicle.time - begin < 1_200_000
    assert not (await told.sticks()).is_valid
    assert (await told.vehicle())[:3] == ("multicopter", False, False)
    if has(types, "vtol_vehicle_status"):
        with pytest.raises(NoAnswerError, match="no vtol_vehicle_status within 1 s: PX4 publishes it on VTOLs"):
            await told.vtol()
    else:
        assert (await told.vtol())[:2] == ("unknown", False)
    if has(types, "wind"):
        with pytest.raises(NoAnswerError, match=r"no wind within 3 s: PX4 publishes it while its estimator fuses"):
            await told.wind()


@pytest.mark.parametrize(
    ("status", "state"),
    [
        ({"vehicle_type": 1}, "multicopter"),
        ({"vehicle_type": 2}, "fixed wing"),
        ({"vehicle_type": 1, "in_transition_mode": True, "in_transition_to_fw": True}, "to fixed wing"),
        ({"vehicle_type": 1, "in_transition_mode": True}, "to multicopter"),
        ({"vehicle_type": 2, "is_vtol": False}, "unknown"),
    ],
)
def test_v1_15_tells_how_a_vtol_flies_in_its_status(px4_types: Any, status: Mapping[str, Any], state: str) -> None:
    found = vtol_of_status(px4_types.VehicleStatus(**{"is_vtol": True, **status}), 0.1)
    assert found == Vtol(state, has_failed=False, age=0.1, is_valid=state != "unknown")  # type: ignore[arg-type]


def test_every_state_and_type_of_the_newest_release_has_a_name(px4_types: Any) -> None:
    """The names are those of the constants."""
    short = {"MC": "multicopter", "FW": "fixed wing", "UNDEFINED": "unknown"}
    start = "VEHICLE_VTOL_STATE_"
    for name in (each for each in dir(px4_types.VtolVehicleStatus) if each.startswith(start)):
        number = getattr(px4_types.VtolVehicleStatus, name)
        state = vtol_of(px4_types.VtolVehicleStatus(vehicle_vtol_state=number), 0.0).state
        to, _, end = name.removeprefix(start).rpartition("TRANSITION_TO_")
        assert state == ("to " if to or "TRANSITION" in name else "") + short[end]
    named = {"ROTARY_WING": "multicopter"}
    start = "VEHICLE_TYPE_"
    for name in (each for each in dir(px4_types.VehicleStatus) if each.startswith(start)):
        kind = kind_of(px4_types.VehicleStatus(vehicle_type=getattr(px4_types.VehicleStatus, name)), 0.0).type
        end = name.removeprefix(start)
        assert kind == named.get(end, end.lower().replace("_", " "))
    assert kind_of(px4_types.VehicleStatus(vehicle_type=4), 0.0) == VehicleKind(
        "unspecified", is_vtol=False, is_tailsitter=False, age=0.0, is_valid=True
    )


@pytest.mark.parametrize(
    ("changed", "is_valid"),
    [({}, True), ({"airspeed_source": -1}, False), ({"airspeed_source": 0}, True), ({"airspeed_source": 4}, True),
     ({"calibrated_airspeed_m_s": math.nan}, False)],
)  # fmt: skip
def test_an_airspeed_is_valid_if_it_has_a_source(changed: Mapping[str, Any], *, is_valid: bool) -> None:
    message = SimpleNamespace(**{**SENSED["AirspeedValidated"], **changed})
    assert isinstance(found := airspeed_of(message, 0.1), Airspeed)
    assert found.is_valid is is_valid
    assert not airspeed_of(message, 0.5).is_valid


def test_sticks_without_a_source_are_not_valid() -> None:
    assert sticks_of(SimpleNamespace(**STICKS), 0.4).is_valid
    assert not sticks_of(SimpleNamespace(**{**STICKS, "valid": False}), 0.4).is_valid


# a mode that a pilot steers


class Steer(Mode, name="Steer"):
    """Flies as the sticks say."""

    requires = Requirement.MANUAL_CONTROL
    setpoints = (TRAJECTORY,)

    async def fly(self) -> None:
        while True:
            sticks = await self.telemetry.sticks()
            if sticks.is_valid:
                self.trajectory(velocity=(3.0 * sticks.pitch, 3.0 * sticks.roll, 0.0))
            else:
                await self.hold()
            await asyncio.sleep(0.04)


@pytest.mark.usefixtures("sensed")
@flying_each(PARTS)
async def test_a_mode_follows_the_sticks_and_needs_them(flight: Flight, vehicle: Flown) -> None:
    await flight.add(Steer)
    await vehicle.in_air(flight)
    with pytest.raises(RefusedError, match=r"Steer: .* there are no sticks"):
        await flight.set_mode(Steer)
    vehicle.world.has_sticks = True
    await asyncio.sleep(0.3)
    await flight.set_mode(Steer)
    await asyncio.sleep(4.0)
    assert vehicle.world.mode == EXTERNAL
    assert vehicle.world.flight.velocity[:2] == pytest.approx((1.5, 0.75), abs=0.1)
    vehicle.world.has_sticks = False
    await vehicle.until(lambda: vehicle.world.mode != EXTERNAL, 1.0)


@pytest.mark.usefixtures("sensed")
@flying(PARTS)
async def test_a_mode_holds_while_the_sticks_are_not_heard(flight: Flight, vehicle: Flown) -> None:
    """PX4 hears them, and stays in the mode."""
    await flight.add(Steer)
    vehicle.world.has_sticks = True
    await vehicle.in_air(flight)
    await flight.set_mode(Steer)
    await asyncio.sleep(3.0)
    vehicle.lost = {"manual_control_setpoint"}
    await asyncio.sleep(4.0)
    assert vehicle.world.mode == EXTERNAL
    assert vehicle.world.flight.velocity[:2] == pytest.approx((0.0, 0.0), abs=0.1)
