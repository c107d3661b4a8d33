"""Tests of a running vehicle in Foxglove, with a client of its websocket."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from msggen.link.link import Route
from msggen.live import Vehicle
from msggen.show.view.live import LiveView
from msggen.show.view.server import Server
from support.fake_link import FakeLink
from support.foxglove_client import FoxgloveClient

NOW = 1_790_000_000_000_000_000


@pytest.fixture
def server() -> Iterator[Server]:
    with Server("test", "127.0.0.1", 0) as server:
        yield server


def test_samples_arrive_unchanged_with_their_definitions(server: Server, px4_types: Any) -> None:
    link, told = FakeLink(px4_types), list[str]()
    status = px4_types.VehicleStatus(timestamp=7, nav_state=4)
    unknown = Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000)
    with Vehicle(link, px4_types) as vehicle, FoxgloveClient(server.port) as client:
        view = LiveView(server, vehicle, px4_types, told.append)
        vehicle.watch(view)
        remote = link.connect()
        link.open(remote, unknown)
        name = link.route(remote, "vehicle_status_v4").name

        def send() -> bool:
            link.sample(remote, status, when=NOW)
            return bool(client.of(name))

        link.user().sample(remote, unknown, b"\0\1\0\0", NOW)
        client.receive(send)
        channel = next(each for each in client.channels.values() if each["topic"] == name)
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schemaName"] == "px4_msgs/msg/VehicleStatus"
        assert channel["schema"] == px4_types.VehicleStatus.__msg__.definition
        assert (name, NOW, status.encode()) in client.samples
        assert view.samples >= 1

        def check() -> bool:
            view.check()
            link.sample(remote, status, when=NOW)
            return any("no px4_msgs/msg/Mine" in each.get("message", "") for each in client.told)

        client.receive(check)
    reason = f"'/fmu/out/mine': {px4_types.__name__} has no px4_msgs/msg/Mine"
    assert told == [f"not shown, {reason}: build types of the vehicle's firmware and give them with --types"]


def test_a_topic_with_another_definition_is_removed(server: Server, px4_types: Any) -> None:
    link, told = FakeLink(px4_types), list[str]()
    with Vehicle(link, px4_types) as vehicle, FoxgloveClient(server.port) as client:
        view = LiveView(server, vehicle, px4_types, told.append)
        vehicle.watch(view)
        remote = link.connect()

        def send() -> bool:
            link.sample(remote, px4_types.VehicleStatus(), when=NOW)
            return bool(client.samples)

        client.receive(send)
        view.check()
        assert told == []
        seen = view.samples
        vehicle._entry().check.hashes["px4_msgs/msg/VehicleStatus"] = 1
        view.check()
        client.receive(lambda: bool(client.gone))
        link.sample(remote, px4_types.VehicleStatus(), when=NOW)
        assert view.samples == seen
    assert len(told) == 1


def test_the_vehicle_moves_in_3d(server: Server, px4_types: Any) -> None:
    link, cls = FakeLink(px4_types), px4_types.VehicleOdometry
    message = cls(pose_frame=cls.POSE_FRAME_NED, position=(1.0, 2.0, -3.0), q=(1.0, 0.0, 0.0, 0.0))
    place = px4_types.VehicleGlobalPosition(lat=47.4, lon=8.5, alt=500.0)
    with Vehicle(link, px4_types) as vehicle, FoxgloveClient(server.port) as client:
        vehicle.watch(LiveView(server, vehicle, px4_types, print))
        remote = link.connect()

        def send() -> bool:
            link.sample(remote, message, when=NOW)
            link.sample(remote, place, when=NOW)
            server.draw_model(NOW)
            return all(map(client.of, ("/tf", "/pose", "/location", "/vehicle")))

        client.receive(send)
    names = {each["topic"]: each["schemaName"] for each in client.channels.values()}
    assert names["/tf"] == "foxglove.FrameTransform"
    assert names["/pose"] == "foxglove.PoseInFrame"
    assert names["/location"] == "foxglove.LocationFix"
    assert names["/vehicle"] == "foxglove.SceneUpdate"
    assert b"base_link" in client.of("/tf")[0]
    assert b"map" in client.of("/tf")[0]


def test_a_damaged_sample_is_no_error_of_the_view(server: Server, px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        view = LiveView(server, vehicle, px4_types, print)
        watch = vehicle.watch(view)
        link.sample(link.connect(), b"\0\1\0\0", "/fmu/out/vehicle_odometry")
        assert (view.samples, watch.errors) == (1, 0)


def test_a_port_in_use_is_an_error(server: Server) -> None:
    with pytest.raises(OSError, match="in use"):
        Server("test", "127.0.0.1", server.port)


def test_the_address_of_the_application_names_the_server(server: Server) -> None:
    assert json.dumps(str(server.port))[1:-1] in server.app_url
