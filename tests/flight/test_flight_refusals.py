"""Tests of the reasons for which a vehicle refuses to arm in the mode that is selected."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.flight import Flight, RefusedError
from msggen.messages.commands import ARM_DISARM
from msggen.messages.nav_states import HOLD, MODE_NAMES, OFFBOARD
from msggen.messages.refusals import REQUIREMENTS, reasons_for_command
from support.flown import flying_each


@flying_each()
async def test_a_vehicle_that_is_left_in_offboard_mode_tells_how_to_arm_it(flight: Flight) -> None:
    with pytest.raises(ArithmeticError):
        async with flight.offboard():  # the vehicle stays in the mode after an exception
            raise ArithmeticError
    assert flight.mode == "offboard"
    await asyncio.sleep(1.5)
    with pytest.raises(RefusedError) as raised:
        await flight.arm()
    assert raised.value.reasons[:2] == (
        "OffboardControlMode does not arrive at 2 Hz",
        "mode offboard is selected (`hold()` selects another)",
    )
    await flight.hold()
    await flight.arm()


@flying_each()
async def test_the_end_of_an_offboard_block_on_the_ground_leaves_a_vehicle_that_can_be_armed(flight: Flight) -> None:
    async with flight.offboard():
        assert flight.mode == "offboard"
    assert flight.mode == "hold"
    await flight.arm()


def flags(**lacking: set[int]) -> Any:
    """Return FailsafeFlags in which requirements of modes are not met."""
    found = {f"mode_req_{name}": sum(1 << mode for mode in modes) for name, modes in lacking.items()}
    invalid = {REQUIREMENTS[name][0]: True for name in lacking if name in REQUIREMENTS}
    return SimpleNamespace(**found, **invalid, battery_warning=0)


@pytest.mark.parametrize("requirement", [*REQUIREMENTS, "other", "prevent_arming"])
def test_another_mode_is_advised_only_if_it_can_be_armed(requirement: str) -> None:
    for mode, name in MODE_NAMES.items():
        status = SimpleNamespace(nav_state=mode, pre_flight_checks_pass=True)
        advice = f"mode {name} is selected (x selects another)"
        alone = flags(**{requirement: {mode}})
        found = [*reasons_for_command(ARM_DISARM, [1.0], alone, status, "x")]
        assert len(found) == 2 if mode != HOLD else found
        assert (advice in found) == (mode != HOLD)
        both = flags(**{requirement: {mode, HOLD}})
        found = [*reasons_for_command(ARM_DISARM, [1.0], both, status, "x")]
        assert (advice in found) == (requirement == "prevent_arming" and mode != HOLD)


def test_nothing_is_said_of_a_mode_whose_requirements_are_met() -> None:
    status = SimpleNamespace(nav_state=OFFBOARD, pre_flight_checks_pass=False)
    found = [*reasons_for_command(ARM_DISARM, [1.0], flags(mission={3}), status, "x")]
    assert found == ["the preflight checks fail (pre_flight_checks_pass)"]
