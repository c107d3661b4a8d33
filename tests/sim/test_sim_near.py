"""Tests of the vehicle in the process of its program, on the clock that both share."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest

from msggen.sim import Options
from msggen.sim.loop import run
from msggen.sim.near import NearVehicle

HOLD, TAKEOFF, OWN = 4, 17, 23
NAN = (math.nan,) * 7


class Program:
    """Registers a mode, answers its arming checks, and keeps what the vehicle publishes."""

    def __init__(self, types: Any, vehicle: NearVehicle) -> None:
        self.types, self.vehicle = types, vehicle
        self.seen: dict[str, list[Any]] = {}
        for topic in (
            "vehicle_status",
            "vehicle_local_position",
            "vehicle_command_ack",
            "register_ext_component_reply",
        ):
            self.seen[topic] = []
            vehicle.subscribe(topic, self.seen[topic].append)
        vehicle.subscribe("arming_check_request", self.answer)

    def answer(self, request: Any) -> None:
        reply = self.types.ArmingCheckReply(request_id=request.request_id, can_arm_and_run=True)
        self.vehicle.publish("arming_check_reply", reply)

    def command(self, number: int, first: float = math.nan) -> None:
        parameters = {f"param{place}": value for place, value in enumerate((first, *NAN[1:]), 1)}
        message = self.types.VehicleCommand(command=number, source_component=191, **parameters)
        self.vehicle.publish("vehicle_command", message)

    async def fly(self) -> None:
        """Take off, and fly to a place in the own mode."""
        name = b"Near".ljust(25, b"\0")
        request = self.types.RegisterExtComponentRequest(name=name, register_arming_check=True, register_mode=True)
        self.vehicle.publish("register_ext_component_request", request)
        await asyncio.sleep(1.0)
        self.command(22)
        await asyncio.sleep(0.5)
        self.command(400, 1.0)
        while self.seen["vehicle_status"][-1].nav_state != HOLD:  # noqa: ASYNC110 - the clock is simulated
            await asyncio.sleep(0.1)
        self.command(100_001, OWN)
        for _ in range(300):
            self.vehicle.publish("goto_setpoint", self.types.GotoSetpoint(position=(4.0, -3.0, -2.0)))
            await asyncio.sleep(1 / 30)


def flown(types: Any, seed: int = 0) -> Program:
    vehicle = NearVehicle(types, Options(seed=seed))
    program = Program(types, vehicle)
    run(program.fly(), vehicle)
    return program


def test_a_program_flies_a_vehicle_on_its_clock(px4_types: Any) -> None:
    program = flown(px4_types)
    (reply,) = program.seen["register_ext_component_reply"]
    assert (reply.success, reply.mode_id) == (True, OWN)
    assert [each.result for each in program.seen["vehicle_command_ack"]] == [0, 0, 0]
    last = program.seen["vehicle_local_position"][-1]
    assert (last.x, last.y, last.z) == pytest.approx((4.0, -3.0, -2.0), abs=0.3)
    assert program.seen["vehicle_status"][-1].nav_state == OWN
    assert [*dict.fromkeys(each.nav_state for each in program.seen["vehicle_status"])] == [HOLD, TAKEOFF, OWN]


def test_each_flight_is_the_same(px4_types: Any) -> None:
    one, two = flown(px4_types, 3), flown(px4_types, 3)
    assert one.seen == two.seen


def test_neither_side_can_change_the_messages_of_the_other(px4_types: Any) -> None:
    vehicle = NearVehicle(px4_types)
    seen: list[Any] = []
    end = vehicle.subscribe("vehicle_status", seen.append)
    other: list[Any] = []
    vehicle.subscribe("vehicle_status", other.append)

    async def program() -> None:
        await asyncio.sleep(0.6)
        seen[0].nav_state = 99
        end()
        await asyncio.sleep(2.0)

    run(program(), vehicle)
    assert other[0].nav_state == HOLD
    assert 0 < len(seen) < len(other)


def test_unknown_topics_are_errors(px4_types: Any) -> None:
    vehicle = NearVehicle(px4_types)
    with pytest.raises(LookupError, match="does not publish 'goto_setpoint'"):
        vehicle.subscribe("goto_setpoint", print)
    with pytest.raises(LookupError, match="does not read 'vehicle_status'"):
        vehicle.publish("vehicle_status", px4_types.VehicleStatus())
