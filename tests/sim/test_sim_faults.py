"""Tests of what happens to a simulated vehicle in flight: lost position, sticks, battery, link and restarts."""

from __future__ import annotations

import re
from typing import Any

import pytest

from msggen.sim import Options, SimulatedVehicle
from msggen.sim.faults import NAMES, read_fault
from support.mode_program import Program
from support.simulation import NAN, SECOND, Bench

POSITION, HOLD, RETURN, DESCEND, TAKEOFF, LAND = 2, 4, 5, 12, 17, 18
SYNCLESS = Options(sync="off")


def flying(types: Any, *before: str) -> Bench:
    """Return a vehicle that holds in the air. `before` are faults that happen on the ground."""
    bench = Bench(types, SYNCLESS)
    for fault in before:
        bench.vehicle.fault(fault)
    bench.run(0.5)
    assert bench.command(22, *[NAN] * 7) == 0
    assert bench.command(400, 1.0) == 0
    wait(bench, lambda: bench.vehicle.world.mode == HOLD, 15.0)
    return bench


def wait(bench: Bench, is_done: Any, seconds: float) -> None:
    """Let time pass until something is done, and fail if it is not in time."""
    end = bench.now + round(seconds * SECOND)
    while not is_done():
        assert bench.now < end
        bench.run(0.1)


def told(bench: Bench) -> list[str]:
    return [change.text for change in bench.vehicle.changes]


def test_a_lost_position_ends_hold_and_comes_back(px4_types: Any) -> None:
    bench = flying(px4_types)
    bench.vehicle.fault("no-gps")
    wait(bench, lambda: bench.last("vehicle_status").nav_state == DESCEND, 8.0)
    bench.run(0.3)  # until the other topics tell it
    assert bench.last("failsafe_flags").global_position_invalid
    assert not bench.last("vehicle_local_position").xy_valid
    assert bench.last("vehicle_status").failsafe
    bench.vehicle.fault("gps")
    wait(bench, lambda: bench.last("vehicle_status").nav_state == HOLD, 8.0)
    assert "GPS is lost" in told(bench)
    assert "GPS is there again" in told(bench)


def test_lost_sticks_hold_for_5_s_and_return(px4_types: Any) -> None:
    bench = flying(px4_types, "sticks")
    bench.vehicle.fault("no-sticks")
    bench.run(4.5)
    status = bench.last("vehicle_status")
    assert (status.nav_state, status.failsafe) == (HOLD, True)
    bench.run(1.5)
    assert bench.last("vehicle_status").nav_state == RETURN
    bench.vehicle.fault("sticks")
    bench.run(0.5)
    assert bench.last("vehicle_status").nav_state == RETURN  # until a user selects a mode
    bench.vehicle.fault("mode=position")
    bench.run(0.5)
    status = bench.last("vehicle_status")
    assert (status.nav_state, status.failsafe) == (POSITION, False)


def test_a_pilot_takes_over_from_the_mode_of_a_program(px4_types: Any) -> None:
    bench = Bench(px4_types, SYNCLESS)
    bench.run(0.3)
    own = Program(bench, "Square", with_executor=True)
    own.register()
    own.run(0.7)
    bench.vehicle.fault("mode=external-1")
    own.run(0.3)
    assert (own.status.nav_state, own.status.executor_in_charge) == (own.mode, 1)
    bench.vehicle.fault("mode=land")
    own.run(0.3)
    assert (own.status.nav_state, own.status.executor_in_charge) == (LAND, 0)
    assert own.as_executor(400, 1.0) == 1


def test_a_refused_mode_is_told(px4_types: Any) -> None:
    bench = flying(px4_types)
    bench.vehicle.fault("mode=position")
    bench.run(0.1)
    assert "the pilot selects position, which is refused: there are no sticks" in told(bench)


def test_a_battery_can_be_low(px4_types: Any) -> None:
    bench = Bench(px4_types, SYNCLESS)
    bench.vehicle.fault("battery=0.06")
    bench.run(1.0)
    assert bench.last("battery_status").remaining == pytest.approx(0.06, abs=0.001)
    assert bench.last("failsafe_flags").battery_warning == 2
    assert bench.command(400, 1.0) == 1


def test_a_cut_link_carries_nothing(px4_types: Any) -> None:
    bench = Bench(px4_types, SYNCLESS._replace(faults=((4.0, "link"), (1.0, "no-link"))))
    bench.run(3.9)
    assert max(time for time, _, _ in bench.sent) <= SECOND
    bench.run(4.0)
    assert bench.vehicle.is_connected
    assert [text for text in told(bench) if "link" in text] == ["the link is cut", "the link is there again"]


def test_a_restart_of_px4_puts_the_vehicle_at_its_home(px4_types: Any) -> None:
    bench = flying(px4_types)
    bench.vehicle.fault("battery=0.5")
    bench.vehicle.fault("restart")
    bench.run(1.0)
    status = bench.last("vehicle_status")
    assert (status.arming_state, status.nav_state) == (1, HOLD)
    assert bench.last("vehicle_land_detected").landed
    assert bench.last("battery_status").remaining == pytest.approx(0.5, abs=0.01)
    assert not [*bench.messages("vehicle_command_ack")]  # PX4 has no last answer any more


def test_answers_come_again_in_a_new_session(px4_types: Any) -> None:
    bench = Bench(px4_types, SYNCLESS)
    bench.run(0.3)
    bench.command(400, 2.0)
    bench.command(16)
    bench.vehicle.fault("restart-client")
    bench.run(0.5)
    assert [ack.command for ack in bench.messages("vehicle_command_ack")] == [16]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            "no-positon",
            "no fault 'no-positon', did you mean 'no-position'?: there are no-position, position, no-gps, ",
        ),
        ("", "no fault '': there are "),
        ("battery", "'battery=': expected a share from 0 to 1, as in 'battery=0.1'"),
        ("battery=", "'battery=': expected a share from 0 to 1, as in 'battery=0.1'"),
        ("battery=nan", "'battery=nan': expected a share"),
        ("mode=hovre", "'mode=hovre': no such mode: there are manual, altitude, "),
    ],
)
def test_other_texts_are_no_faults(text: str, error: str) -> None:
    with pytest.raises(ValueError, match=re.escape(error)):
        read_fault(text)


def test_a_vehicle_refuses_times_of_no_faults(px4_types: Any) -> None:
    with pytest.raises(ValueError, match="no fault 'storm'"):
        SimulatedVehicle(px4_types, Options(faults=((1.0, "storm"),)))


def test_every_fault_happens(px4_types: Any) -> None:
    values = {"battery=SHARE": "battery=0.3", "mode=MODE": "mode=land"}
    faults = tuple((1.0 + number / 10, values.get(name, name)) for number, name in enumerate(NAMES))
    bench = Bench(px4_types, SYNCLESS._replace(faults=faults))
    bench.run(4.0)
    assert len([text for text in told(bench) if not re.search("connected|armed", text)]) == len(NAMES)
