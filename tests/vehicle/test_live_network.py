"""Tests of vehicles that the owner of a link carries to Zenoh: programs on the network see and command them."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import ExitStack, suppress
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.link.rmw_zenoh.names import Attachment, parse_attachment, parse_token
from msggen.live import LinkError, LinkTimeoutError, TopicError, Vehicle
from msggen.vehicle.command import send_command
from support.networked import CALM, networked, standing
from support.ports import free_port
from support.zenoh_space import GUID, OTHER, session

pytest.importorskip("zenoh")
pytest_plugins = ["support.owned_links"]


def until(condition: Any, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def accepted(vehicle: Vehicle, command: Any) -> bool:
    """Whether a vehicle accepts a command. A busy computer can let it wait for more than 0.5 s: it is sent again."""
    for _ in range(5):
        with suppress(LinkTimeoutError):
            return bool(send_command(vehicle, command, 4.0).result == 0)
    return False


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
        assert accepted(vehicle, command)
        assert not space.simulator.vehicles[0].refused
        with vehicle.every(10, px4_types.RoverSpeedSetpoint()):
            until(lambda: "/uav_1/fmu/in/rover_speed_setpoint" in space.simulator.vehicles[0].received)
        with pytest.raises(TopicError, match="there are no services on Zenoh: publish VehicleCommand"):
            vehicle.call(px4_types.srv.VehicleCommand.Request())
        assert vehicle.lost == 0


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
        with second.every(10, px4_types.VehicleCommand(command=400, target_system=2)):
            until(lambda: "/uav_2/fmu/in/vehicle_command" in space.simulator.vehicles[1].received)
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
                with vehicle.every(10, px4_types.OffboardControlMode()):
                    until(lambda: "/fmu/in/offboard_control_mode" in first.simulator.vehicles[0].received)


def test_what_cannot_be_sent_raises(px4_types: Any) -> None:
    with networked(px4_types) as space, Vehicle(space.url, px4_types, direct=True) as vehicle:
        vehicle.wait_connected(20.0)
        space.simulator.close()
        assert vehicle.wait_disconnected(20.0).startswith("its tokens are gone")
        with pytest.raises(LinkError):
            vehicle.publish(px4_types.OffboardControlMode())


@pytest.mark.parametrize(("end", "code"), [("", 0), ("raise SystemExit(3)", 3)])
def test_a_program_that_does_not_close_its_vehicle_ends(px4_types: Any, end: str, code: int) -> None:
    with networked(px4_types) as space:
        program = f"""
from msggen.generate.cache import package_of
from msggen.live import Vehicle
vehicle = Vehicle({space.url!r}, package_of("v1.18"), direct=True)
vehicle.wait_connected(20.0)
vehicle.subscribe("vehicle_attitude").wait_for(lambda _: True, 20.0)
{end}
"""
        done = subprocess.run([sys.executable, "-c", program], timeout=60.0, check=False, capture_output=True)
    assert (done.returncode, done.stderr) == (code, b"")


def test_a_router_that_was_killed_and_is_back_has_the_vehicle_again(px4_types: Any) -> None:
    port = free_port()
    with session(port, "router") as router, networked(px4_types, port=port) as space:
        assert not space.network._connection.is_router
        with Vehicle(space.url, px4_types, direct=True) as vehicle:
            vehicle.wait_connected(20.0)
            attitudes = vehicle.subscribe("vehicle_attitude")
            attitudes.wait_for(lambda _: True, 10.0)
            router.close()
            vehicle.wait_disconnected(20.0)
            with pytest.raises(LinkError):
                vehicle.publish(px4_types.OffboardControlMode())
            vehicle.wait_connected(30.0)  # one of the two is the router now, and the other one its client
            attitudes.wait_for(lambda _: True, 10.0)
            with vehicle.every(10, px4_types.OffboardControlMode()):
                until(lambda: "/fmu/in/offboard_control_mode" in space.simulator.vehicles[0].received)


def test_a_command_reaches_one_of_two_namesakes_whose_router_was_lost(px4_types: Any, monkeypatch: Any) -> None:
    """Neither sees the tokens of the other one while there is no router."""
    monkeypatch.setattr("msggen.link.rmw_zenoh.connection._ALONE_S", 60.0)
    port = free_port()
    with ExitStack() as stack:
        router = stack.enter_context(session(port, "router"))
        first = stack.enter_context(networked(px4_types, port=port))
        until(lambda: first.network._flows)
        second = stack.enter_context(networked(px4_types, port=port))
        until(lambda: second.network._namespaces._tokens and second.network._entries)
        both = (first.network, second.network)
        router.close()
        until(lambda: not any(each._connection.has_router for each in both))
        until(lambda: second.network._namespaces._left)
        stack.enter_context(session(port, "router"))
        vehicle = stack.enter_context(Vehicle(first.url, px4_types, direct=True))
        vehicle.wait_connected(30.0)
        until(lambda: not second.network._namespaces._left and all(each._connection.has_router for each in both))
        until(lambda: sum(bool(each._flows) for each in both) == 1)
        name = "/fmu/in/offboard_control_mode"
        with vehicle.every(10, px4_types.OffboardControlMode()):
            until(lambda: any(name in each.simulator.vehicles[0].received for each in (first, second)))
        assert sum(name in each.simulator.vehicles[0].received for each in (first, second)) == 1


def test_what_is_late_or_no_sample_does_not_reach_the_vehicle(px4_types: Any) -> None:
    """A node of ROS 2 whose samples waited, or whose clock is behind; and bytes that are no sample."""
    message = px4_types.OffboardControlMode(position=True)
    key = f"0/fmu/in/offboard_control_mode/{message.__msg__.dds_type}/{message.__msg__.type_hash}"
    with networked(px4_types) as space, session(int(space.url.rpartition(":")[2])) as stranger:
        until(lambda: "/fmu/out/vehicle_attitude" in {name for _, name in space.network._flows})

        def put(payload: bytes, age: float = 0.0, gid: bytes = GUID) -> None:
            attachment = Attachment(1, time.time_ns() - round(age * 1e9), gid).pack()
            stranger.put(key, payload, attachment=attachment)

        refused = space.network.refusals.counts
        put(message.encode(), age=0.6)
        stranger.put(key, message.encode())
        put(message.encode()[:-1])
        put(b"\0\7\0\0" + bytes(3))
        until(lambda: refused["/fmu/in/offboard_control_mode"] == 4)
        put(message.encode(), age=-100.0, gid=OTHER)  # its clock is ahead, which tells nothing
        put(message.encode(), age=-99.0, gid=OTHER)
        put(b"x", age=-1e9)  # forged
        until(lambda: refused["/fmu/in/offboard_control_mode"] == 7)
        received = space.simulator.vehicles[0].received

        def arrives() -> bool:
            put(px4_types.encapsulation.encode_as(message, b"\0\0"))  # big-endian; arrives as PX4 takes it
            return bool(received["/fmu/in/offboard_control_mode"] >= 2)

        until(arrives)
        assert not space.simulator.vehicles[0].refused


def test_the_form_on_the_network_is_that_of_rmw_zenoh(px4_types: Any) -> None:
    """Tokens with ids that differ and the QoS of PX4's endpoints, a gid for each publisher, times since 1970."""
    options = CALM._replace(key=3, namespace="uav_1")
    tokens: set[str] = set()
    samples: list[Any] = []
    with networked(px4_types, [options]) as space, session(int(space.url.rpartition(":")[2])) as stranger:
        until(lambda: len(space.network._flows) == 31)
        found = [str(reply.ok.key_expr) for reply in stranger.liveliness().get("@ros2_lv/**")]
        tokens.update(found)
        stranger.declare_subscriber("0/uav_1/fmu/out/vehicle_status_v4/**", samples.append)
        stranger.declare_subscriber("0/uav_1/fmu/out/vehicle_attitude/**", samples.append)
        until(lambda: len({str(each.key_expr) for each in samples}) == 2)
    parsed = [parse_token(text) for text in tokens]
    assert None not in parsed
    assert len(tokens) == 70
    assert len({text.split("/")[4] for text in tokens}) == 70
    assert {text.split("/")[7] for text in tokens} == {"%uav_1"}
    assert {each.node for each in parsed if each} == {"msggen_3"}
    kinds = Counter(each.kind for each in parsed if each)
    assert kinds == {"NN": 1, "MP": 31, "MS": 38}
    status = px4_types.VehicleStatus.__msg__
    expected = f"%uav_1%fmu%out%vehicle_status_v4/{status.dds_type}/{status.type_hash}/2::,:,:,:,,"
    assert any(text.endswith(expected) for text in tokens)
    assert any("%vehicle_command/" in text and text.endswith("/2::,16:,:,:,,") for text in tokens)
    attachments = {str(each.key_expr): parse_attachment(bytes(each.attachment)) for each in samples}
    assert len({each.gid for each in attachments.values() if each}) == 2
    assert all(each and abs(time.time() - each.time / 1e9) < 30.0 for each in attachments.values())
    sizes = {4 + cls.__msg__.cdr_size for cls in (px4_types.VehicleStatus, px4_types.VehicleAttitude)}
    assert {len(bytes(each.payload)) for each in samples} == sizes  # no surplus


def test_a_vehicle_of_v1_14_tells_no_definitions_and_has_those_of_its_release() -> None:
    older = package_of("v1.14")
    with networked(older) as space, Vehicle(space.url, older, direct=True) as vehicle:
        vehicle.wait_connected(20.0)
        assert str(vehicle.wait_firmware(10.0)) == "v1.14"
        assert type(vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)) is older.VehicleStatus
        with vehicle.every(10, older.OffboardControlMode()):
            until(lambda: space.simulator.vehicles[0].received)


def test_topics_without_a_definition_are_named_with_the_cure(px4_types: Any, caplog: Any) -> None:
    with networked(px4_types, types=package_of("v1.16")) as space:
        until(lambda: "not on the network, because no types have the vehicle's definitions" in caplog.text)
        assert "/fmu/out/vehicle_status_v4" in caplog.text
        assert "--px4 PX4-Autopilot" in caplog.text
        assert not any("vehicle_status_v4" in name for _, name in space.network._flows)


def test_a_slow_reader_loses_its_own_samples_only(px4_types: Any) -> None:
    hung = threading.Event()
    with networked(px4_types, [CALM._replace(rate=None)]) as space:
        port = int(space.url.rpartition(":")[2])
        with session(port) as slow, Vehicle(space.url, px4_types, direct=True) as vehicle:
            slow.declare_subscriber("**/fmu/out/**", lambda _: hung.wait(20.0))
            vehicle.wait_connected(20.0)
            attitudes = vehicle.subscribe("vehicle_attitude")
            for _ in range(50):
                attitudes.wait_for(lambda _: True, 10.0)
            assert vehicle.lost == 0
            command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1, from_external=True)
            assert accepted(vehicle, command)
            hung.set()


def test_what_waits_in_a_connection_that_stands_still_does_not_reach_the_vehicle(px4_types: Any) -> None:
    """TCP delivers it when the connection is back, later than 0.5 s after it was published."""
    ages: list[float] = []
    with (
        networked(px4_types) as space,
        standing(int(space.url.rpartition(":")[2])) as (port, still),
        Vehicle(f"zenoh://127.0.0.1:{port}", px4_types, direct=True) as vehicle,
    ):
        link = space.network._link
        publish = link.publish

        def watched(remote: Any, route: Any, payload: bytes, until: int = 0) -> None:
            if route.name.endswith("offboard_control_mode"):
                ages.append(time.time() - px4_types.OffboardControlMode.decode(payload).timestamp / 1e6)
            publish(remote, route, payload, until)

        link.publish = watched  # type: ignore[method-assign]
        vehicle.wait_connected(20.0)

        def message() -> Any:
            return px4_types.OffboardControlMode(timestamp=time.time_ns() // 1000)

        with vehicle.every(50, message):
            until(lambda: len(ages) > 10)
            still.set()
            time.sleep(1.5)
            before = len(ages)
            still.clear()
            until(lambda: len(ages) > before + 10)
        assert space.network.refusals.counts["/fmu/in/offboard_control_mode"] > 5
    assert max(ages) < 0.6


@pytest.mark.usefixtures("owned")
def test_programs_share_a_link_to_a_network(px4_types: Any) -> None:
    """A process owns it for both, asks for last samples there, and subscribes to what they follow together."""
    with networked(px4_types) as space, Vehicle(space.url, px4_types) as first, Vehicle(space.url, px4_types) as second:
        assert first.is_shared
        assert first.wait_connected(20.0) == second.wait_connected(20.0)
        assert str(second.wait_firmware(10.0)) == "v1.18"
        home = first.subscribe("home_position")
        until(lambda: home.latest() is not None)
        with second.subscribe("vehicle_attitude") as attitudes:
            attitudes.wait_for(lambda _: True, 10.0)
        (vehicle,) = space.server.owner.vehicles.values()
        names = {"/fmu/out/home_position_v1"}
        until(lambda: {name for name, row in vehicle.rows.items() if row.programs} == names)
        command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1, from_external=True)
        assert accepted(second, command)
