"""Tests of vehicles that the owner of a link carries to Zenoh: programs on the network see and command them."""

from __future__ import annotations

import time
from typing import Any

import pytest

from msggen.live import LinkError, TopicError, Vehicle
from msggen.vehicle.command import send_command
from support.networked import CALM, networked

pytest.importorskip("zenoh")


def until(condition: Any, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_program_on_the_network_has_the_vehicle_as_over_udp(px4_types: Any) -> None:
    options = CALM._replace(key=7, namespace="uav_1", rate=None, sync="short")
    with networked(px4_types, [options]) as space, Vehicle(space.url, px4_types, direct=True) as vehicle:
        remote = vehicle.wait_connected(20.0)
        assert (remote.key, remote.namespace, remote.guid) == (7, "uav_1", "")
        names = {f"/uav_1{each.ros_name}" for each in px4_types.topics.ENDPOINTS}
        assert {route.name for route in vehicle.routes} == names
        assert str(vehicle.wait_firmware(10.0)) == "v1.18"
        status = vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)
        assert abs(time.time() - status.timestamp / 1e6) < 5.0  # UTC
        assert abs(vehicle.time / 1e6 - time.time()) < 5.0
        command = px4_types.VehicleCommand(
            timestamp=vehicle.time, command=400, param1=1.0, target_system=status.system_id, from_external=True
        )
        assert send_command(vehicle, command, 10.0).result == 0
        assert not space.simulator.vehicles[0].refused
        vehicle.publish(px4_types.RoverSpeedSetpoint())
        until(lambda: "/uav_1/fmu/in/rover_speed_setpoint" in space.simulator.vehicles[0].received)
        with pytest.raises(TopicError, match="there are no services on Zenoh: publish VehicleCommand"):
            vehicle.call(px4_types.srv.VehicleCommand.Request())
        assert vehicle.lost == 0
        assert not space.network.refusals.counts


def test_only_what_is_asked_for_crosses_the_network(px4_types: Any) -> None:
    with networked(px4_types) as space, Vehicle(space.url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(20.0)
        with vehicle.subscribe("vehicle_attitude") as attitudes:
            for _ in range(5):
                attitudes.wait_for(lambda _: True, 10.0)
        (carried,) = space.server.owner.vehicles.values()
        assert {name for name, row in carried.rows.items() if row.programs} == {"/fmu/out/vehicle_attitude"}
        until(lambda: not any(row.programs for row in carried.rows.values()))
        assert {name for (_, name), flow in space.network._flows.items() if flow.sequence} == {
            "/fmu/out/vehicle_attitude"
        }


def test_the_last_sample_is_known_at_once(px4_types: Any) -> None:
    with networked(px4_types) as space, Vehicle(space.url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(20.0)
        home = vehicle.subscribe("home_position")
        until(lambda: home.latest() is not None)
        found = home.latest()
        assert found is not None
        assert found.valid_hpos


def test_two_vehicles_have_a_key_space_each(px4_types: Any) -> None:
    several = [CALM._replace(key=number, namespace=f"uav_{number}", rate=2.0) for number in (1, 2)]
    with (
        networked(px4_types, several) as space,
        Vehicle(space.url, px4_types, namespace="uav_1", direct=True) as first,
        Vehicle(space.url, px4_types, key=2, direct=True) as second,
    ):
        assert first.wait_connected(20.0).key == 1
        assert second.wait_connected(20.0).namespace == "uav_2"
        for vehicle, number in ((first, 1), (second, 2)):
            status = vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)
            assert status.system_id == number
        second.publish(px4_types.VehicleCommand(command=400, target_system=2))
        until(lambda: space.simulator.vehicles[1].received)
        assert "/uav_1/fmu/in/vehicle_command" not in space.simulator.vehicles[0].received


def test_the_second_of_two_namesakes_is_refused_with_the_cure(px4_types: Any, caplog: Any) -> None:
    with (
        networked(px4_types, [CALM._replace(key=number) for number in (1, 2)]) as space,
        Vehicle(space.url, px4_types, direct=True) as vehicle,
    ):
        vehicle.wait_connected(20.0)
        until(lambda: "not carried" in caplog.text)
        assert "both have no namespace: give each one its own, `uxrce_dds_client start -n uav_1`" in caplog.text
        assert "--key" not in caplog.text
        assert not vehicle.others


def test_a_namesake_of_another_owner_is_refused_until_the_first_one_ends(px4_types: Any, caplog: Any) -> None:
    port = 0
    with networked(px4_types) as first:
        port = int(first.url.rpartition(":")[2])
        with Vehicle(first.url, px4_types, direct=True) as vehicle:
            vehicle.wait_connected(20.0)
            with networked(px4_types, [CALM._replace(key=2)], port=port):
                until(lambda: "another program publishes topics without a namespace on this network" in caplog.text)
                assert not vehicle.others
                vehicle.publish(px4_types.OffboardControlMode())
                until(lambda: first.simulator.vehicles[0].received)


def test_what_cannot_be_sent_raises(px4_types: Any) -> None:
    with networked(px4_types) as space, Vehicle(space.url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(20.0)
        space.simulator.close()
        assert vehicle.wait_disconnected(20.0).startswith("its tokens are gone")
        with pytest.raises(LinkError):
            vehicle.publish(px4_types.OffboardControlMode())
