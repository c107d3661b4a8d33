"""Tests of Vehicle over real links, with simulated vehicles at the other end."""

from __future__ import annotations

import asyncio
import gc
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from msggen.live import FormatError, LinkError, LinkTimeoutError, Vehicle
from msggen.sim import Options, Simulator
from support.lines import joined
from support.link_records import nothing_is_left
from support.ports import free_port
from support.replay import DELETE, GET_INFO, Client, kind, sent

WAIT = 20.0


@pytest.fixture
def url() -> Iterator[str]:
    with nothing_is_left():
        yield f"udp://127.0.0.1:{free_port()}"
        gc.collect()


@contextmanager
def simulated(package: Any, url: str, **options: Any) -> Iterator[Any]:
    with Simulator(package, url, [Options(sync="off", **options)]) as simulator:
        yield simulator.vehicles[0]


@contextmanager
def addresses(scheme: str) -> Iterator[tuple[str, str]]:
    """Yield the address for a Vehicle and the one for its simulated vehicle. An agent is behind a tap."""
    udp = f"udp://127.0.0.1:{free_port()}"
    if scheme == "serial":
        with joined() as (ours, theirs):
            yield f"serial://{ours}?baud=115200", f"serial://{theirs}?baud=115200"
    elif scheme == "tap":
        with Vehicle(f"udp://127.0.0.1:{free_port()}") as agent:
            yield f"{udp.replace('udp', 'tap')}?agent={agent._name.removeprefix('udp://')}", udp
    else:
        yield udp, udp


@pytest.mark.parametrize("scheme", ["udp", "serial", "tap"])
def test_messages_come_and_go(scheme: str, px4_types: Any) -> None:
    with (
        nothing_is_left(),
        addresses(scheme) as (url, other),
        Vehicle(url) as vehicle,
        simulated(px4_types, other, namespace="uav_1", rate=20.0) as simulated_vehicle,
    ):
        status = vehicle.subscribe(px4_types.VehicleStatus)
        remote = vehicle.wait_connected(WAIT)
        assert (remote.key, remote.namespace, remote.continued) == (1, "uav_1", False)
        assert len(vehicle.routes) == len(px4_types.topics.ENDPOINTS)
        assert type(status.wait_for(lambda _: True, WAIT)) is px4_types.VehicleStatus
        for _ in range(3):
            vehicle.publish(px4_types.TrajectorySetpoint(timestamp=vehicle.time))
        command = px4_types.VehicleCommand(
            command=px4_types.VehicleCommand.VEHICLE_CMD_REQUEST_MESSAGE, target_system=1, target_component=1
        )
        request = px4_types.srv.VehicleCommand.Request(request=command)
        if scheme == "tap":
            with pytest.raises(LinkError, match="cannot be called through a tap"):
                vehicle.call(request, WAIT)
        else:
            reply = vehicle.call(request, WAIT)
            assert type(reply) is px4_types.srv.VehicleCommand.Response
            assert reply.reply.command == command.command
        assert str(vehicle.wait_firmware(WAIT)) == "v1.18"
        assert vehicle.firmware.is_complete
        assert len(vehicle.firmware.hashes) == len({each.message for each in px4_types.topics.ENDPOINTS})
        assert (vehicle.lost, status.undecodable) == (0, 0)
        assert vehicle.statistics.received > 0
    assert simulated_vehicle.received["/uav_1/fmu/in/trajectory_setpoint"] == 3


def test_a_tap_and_its_agent_serve_one_vehicle(url: str, px4_types: Any) -> None:
    """The agent's program does all that it does without a tap, and the tap's program reads and publishes beside it."""
    tap = f"tap://127.0.0.1:{free_port()}"
    with (
        Vehicle(url) as agent,
        Vehicle(f"{tap}?agent={url.removeprefix('udp://')}") as vehicle,
        simulated(px4_types, tap.replace("tap", "udp"), rate=50.0) as simulated_vehicle,
    ):
        subscriptions = [each.subscribe(px4_types.VehicleStatus) for each in (agent, vehicle)]
        for each, subscription in zip((agent, vehicle), subscriptions, strict=True):
            assert each.wait_connected(WAIT).key == 1
            subscription.wait_for(bool, WAIT)
        for _ in range(10):
            agent.publish(px4_types.TrajectorySetpoint())
            vehicle.publish(px4_types.OffboardControlMode())
        command = px4_types.VehicleCommand(command=400, param1=1.0, target_system=1)
        assert agent.call(px4_types.srv.VehicleCommand.Request(request=command), WAIT).reply.result == 0
        subscriptions[1].wait_for(lambda message: message.arming_state == message.ARMING_STATE_ARMED, WAIT)
        vehicle.publish(px4_types.VehicleCommand(command=400, param1=0.0, target_system=1))
        subscriptions[0].wait_for(lambda message: message.arming_state != message.ARMING_STATE_ARMED, WAIT)
        assert (agent.lost, vehicle.lost) == (0, 0)
        assert simulated_vehicle.received["/fmu/in/trajectory_setpoint"] == 10
        assert simulated_vehicle.received["/fmu/in/offboard_control_mode"] == 10


def test_two_vehicles_share_a_port(url: str, px4_types: Any) -> None:
    with Vehicle(url, px4_types, key=1) as first, Vehicle(url, px4_types, key=2) as second:
        options = [Options(key=key, sync="off", rate=50.0) for key in (2, 1)]
        with Simulator(px4_types, url, options):
            assert [vehicle.wait_connected(WAIT).key for vehicle in (first, second)] == [1, 2]
            systems = [
                vehicle.subscribe("vehicle_status").wait_for(bool, WAIT).system_id for vehicle in (first, second)
            ]
            assert systems == [1, 2]
            first.close()
            assert second.is_connected
            second.subscribe("vehicle_status").wait_for(bool, WAIT)


def test_a_vehicle_that_is_not_allowed_is_refused(url: str, px4_types: Any) -> None:
    refused = pytest.raises(LinkTimeoutError, match=r"refused .*check whether the vehicle's address is allowed")
    with Vehicle(url, allow=["10.0.0.0/8", 3]) as vehicle, simulated(px4_types, url), refused:
        vehicle.wait_connected(0.3)


def test_a_tap_without_an_agent_says_so(px4_types: Any) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        agent = f"127.0.0.1:{silent.getsockname()[1]}"
        url = f"127.0.0.1:{free_port()}"
        expected = f"datagrams? of a client arrived, but no agent answers at {agent}: start it with MicroXRCEAgent"
        tap = Vehicle(f"tap://{url}?agent={agent}")
        client = simulated(px4_types, f"udp://{url}")
        with tap as vehicle, client, pytest.raises(LinkTimeoutError, match=expected):
            vehicle.wait_connected(1.5)


def test_a_vehicle_that_has_not_opened_its_topics_yet_is_told(url: str, px4_types: Any) -> None:
    client = Simulator(px4_types, url, [Options(sync="px4")])
    with Vehicle(url) as vehicle, client, pytest.raises(LinkTimeoutError, match="has not opened its topics yet, which"):
        vehicle.wait_connected(0.5)


def test_a_client_without_a_session_is_told(url: str) -> None:
    with Vehicle(url) as vehicle, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        ping = next(data for data in sent("session-udp") if kind(data) == GET_INFO)
        timer = threading.Timer(0.1, client.sendto, (ping, ("127.0.0.1", int(url.rpartition(":")[2]))))
        timer.start()
        with pytest.raises(LinkTimeoutError, match="1 datagram of a client arrived, but it has not begun a session"):
            vehicle.wait_connected(0.5)


def test_a_program_that_restarts_continues_the_session(url: str, px4_types: Any) -> None:
    with simulated(px4_types, url, rate=50.0) as simulated_vehicle:
        with Vehicle(url, px4_types) as vehicle:
            vehicle.wait_connected(WAIT)
            vehicle.subscribe("vehicle_status").wait_for(bool, WAIT)
            hub = vehicle._hub
            hub.link.agent.close = lambda *_: None  # type: ignore[attr-defined] # the program ends without a word
        with Vehicle(url, px4_types) as vehicle:
            remote = vehicle.wait_connected(WAIT)
            vehicle.subscribe("vehicle_status").wait_for(bool, WAIT)
            assert remote.continued
            assert vehicle.call(px4_types.srv.VehicleCommand.Request(), WAIT).reply.command == 0
            assert str(vehicle.wait_firmware(WAIT)) == "v1.18"
        assert simulated_vehicle.sent


@pytest.mark.parametrize("capture", ["session-udp", "session-namespace", "session-fragment"])
def test_a_captured_vehicle_is_recognized(url: str, px4_types: Any, capture: str) -> None:
    """What PX4's client of v1.17 sent in a capture, without an answer to format requests."""
    with Vehicle(url, px4_types) as vehicle, Client(int(url.rpartition(":")[2])) as client:
        combined, status = vehicle.subscribe("sensor_combined"), vehicle.subscribe("vehicle_status")
        client.play([data for data in sent(capture) if kind(data) != DELETE])
        combined.wait_for(lambda _: True, WAIT)
        assert str(vehicle.firmware) == "v1.17"
        assert len(vehicle.routes) == 65
        assert combined.undecodable == 0
        with pytest.raises(FormatError, match=r"is version 4: give types of its release too, .*package_of\('v1.17'\)"):
            status.latest()


def test_asyncio_reads_two_topics_of_a_vehicle(url: str, px4_types: Any) -> None:
    async def count(vehicle: Vehicle, topic: str) -> int:
        seen = 0
        async for _ in vehicle.subscribe(topic):
            seen += 1
            if seen == 20:
                break
        return seen

    async def main() -> list[int]:
        with Vehicle(url, px4_types) as vehicle, simulated(px4_types, url, rate=100.0):
            counts = [count(vehicle, "vehicle_status"), count(vehicle, "vehicle_attitude")]
            found = await asyncio.wait_for(asyncio.gather(*counts), WAIT)
            assert not [thread for thread in threading.enumerate() if thread.name.startswith("asyncio")]
            return found

    assert asyncio.run(main()) == [20, 20]
