"""Tests of topics by any spelling, and of their delays."""

from __future__ import annotations

import math
import statistics
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from msggen.link.link import Route
from msggen.live import TopicError
from msggen.messages.lookup import all_topics, endpoint_at, message_named, named_topic
from msggen.vehicle.delay import Delays, offsets_of
from support.fake_link import routes_of

SECOND = 1_000_000_000
STATUS = "/fmu/out/vehicle_status_v4"


@pytest.mark.parametrize(
    "text",
    [
        "vehicle_status",
        "vehicle_status_v4",
        "vehicle_status_v1",
        "/fmu/out/vehicle_status",
        STATUS,
        "fmu/out/vehicle_status",
        f"rt{STATUS}",
        "VehicleStatus",
        "px4_msgs/msg/VehicleStatus",
        "px4_msgs::msg::dds_::VehicleStatus_",
    ],
)
def test_a_topic_has_many_spellings(text: str, px4_types: Any) -> None:
    for routes in (routes_of(px4_types), ()):
        found = named_topic(text, "out", px4_types, routes)
        assert (found.name, found.direction, found.message) == (STATUS, "out", px4_types.VehicleStatus)
        assert (found.route is None) == (not routes)


@pytest.mark.parametrize(
    "text", ["vehicle_status", "/uav_1/fmu/out/vehicle_status", f"/uav_1{STATUS}", "VehicleStatus"]
)
def test_the_name_is_that_of_the_vehicle(text: str, px4_types: Any) -> None:
    routes = [route._replace(name=route.name.replace("_v4", "_v9")) for route in routes_of(px4_types, "uav_1")]
    found = named_topic(text, "out", px4_types, routes)
    assert (found.name, found.message) == ("/uav_1/fmu/out/vehicle_status_v9", px4_types.VehicleStatus)


def test_every_endpoint_is_found_by_all_its_names(px4_types: Any) -> None:
    routes = routes_of(px4_types)
    for endpoint in px4_types.topics.ENDPOINTS:
        for text in (endpoint.uorb_topic, endpoint.ros_name, endpoint.ros_name[1:], endpoint.dds_name):
            found = named_topic(text, endpoint.direction, px4_types, routes)
            if endpoint.uorb_topic != text:
                assert found.name == endpoint.ros_name
            assert found.message is not None
            assert found.direction == endpoint.direction
            assert found.endpoint == endpoint_at(px4_types, found.name)


def test_topics_that_the_package_does_not_know_are_found(px4_types: Any) -> None:
    mine = Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000)
    for text in ("mine", "fmu/out/mine", "/fmu/out/mine", "rt/fmu/out/mine", "mine_v3"):
        found = named_topic(text, "out", px4_types, [mine])
        assert (found.name, found.endpoint, found.message) == ("/fmu/out/mine", None, None)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("vehicle_statsu", "no topic 'vehicle_statsu', did you mean 'vehicle_status'?"),
        ("VehicleStatsu", "did you mean 'px4_msgs/msg/VehicleStatus'?"),
        (
            "esc_status",
            "'esc_status' is a uORB topic that does not cross the bridge: it is not in dds_topics.yaml; add it",
        ),
        ("EscStatus", "no topic of the bridge has the message EscStatus: 'esc_status' is on uORB only"),
        ("qqqq", "no topic 'qqqq'"),
    ],
)
def test_a_wrong_name_gets_the_right_one(text: str, error: str, px4_types: Any) -> None:
    with pytest.raises(TopicError) as raised:
        named_topic(text, "out", px4_types, routes_of(px4_types))
    assert error in str(raised.value)
    assert "endpoint" not in str(raised.value)


def test_a_message_of_several_topics_needs_a_name(px4_types: Any) -> None:
    assert named_topic("VehicleCommand", "in", px4_types, ()).name == "/fmu/in/vehicle_command"
    assert named_topic("VehicleOdometry", "out", px4_types, ()).name == "/fmu/out/vehicle_odometry"
    with pytest.raises(TopicError, match="name one of '/fmu/in/vehicle_mocap_odometry', '/fmu/in/vehicle_visual_"):
        named_topic("VehicleOdometry", "in", px4_types, ())


def test_messages_are_found_by_name_and_type(px4_types: Any) -> None:
    for text in ("VehicleCommand", "px4_msgs/msg/VehicleCommand", "px4_msgs/VehicleCommand"):
        assert message_named(text, px4_types) is px4_types.VehicleCommand
    with pytest.raises(KeyError, match="VehicleCommand"):
        message_named("VehicleComand", px4_types)


def test_all_topics_are_those_of_the_vehicle_and_of_the_package(px4_types: Any) -> None:
    routes = [*routes_of(px4_types)[5:], Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000)]
    found = all_topics(px4_types, routes)
    assert [topic.name for topic in found] == sorted(
        {*(endpoint.ros_name for endpoint in px4_types.topics.ENDPOINTS), "/fmu/out/mine"}
    )
    assert {topic.name for topic in found if topic.route} == {route.name for route in routes}
    spaced = all_topics(px4_types, routes_of(px4_types, "uav_1"))
    assert [topic.name for topic in spaced] == sorted(f"/uav_1{each.ros_name}" for each in px4_types.topics.ENDPOINTS)
    assert all(topic.message for topic in spaced)


# Delays


@given(
    st.lists(st.tuples(st.integers(0, 3 * SECOND), st.integers(-50_000, 200_000)), min_size=1, max_size=30),
    st.booleans(),
)
def test_delays_are_those_of_the_window(px4_types: Any, rows: list[tuple[int, int]], big: bool) -> None:  # noqa: FBT001
    route = next(route for route in routes_of(px4_types) if route.name == "/fmu/out/vehicle_odometry")
    delays, start = Delays(lambda _: px4_types.VehicleOdometry, window=2.0), 10**18
    encode = px4_types.encapsulation.encode_as
    arrivals = sorted(start + after for after, _ in rows)
    for arrival, (_, delay_us) in zip(arrivals, rows, strict=True):
        stamp = arrival // 1000 - delay_us
        message = px4_types.VehicleOdometry(timestamp=stamp, timestamp_sample=stamp - 1000)
        delays(route, encode(message, b"\0\0") if big else message.encode(), arrival)
    first, second = delays.delays(arrivals[-1])
    expected = [
        (arrival - (arrival // 1000 - delay_us) * 1000) / SECOND
        for arrival, (_, delay_us) in zip(arrivals, rows, strict=True)
        if arrivals[-1] - arrival <= 2 * SECOND
    ]
    assert (first.topic, first.field, second.field) == (route.name, "timestamp", "timestamp_sample")
    assert (first.window, first.shortest, first.longest) == (len(expected), min(expected), max(expected))
    assert math.isclose(first.mean, statistics.fmean(expected), abs_tol=1e-12)
    assert math.isclose(first.deviation, statistics.pstdev(expected), abs_tol=1e-9)
    assert math.isclose(second.mean, first.mean + 0.001, abs_tol=1e-9)
    assert first.is_in_sync


def test_clocks_that_are_not_in_sync_are_noticed(px4_types: Any) -> None:
    route = next(route for route in routes_of(px4_types) if route.name == STATUS)
    delays = Delays(lambda _: px4_types.VehicleStatus)
    delays(route, px4_types.VehicleStatus().encode(), 10**18)
    assert delays.delays(10**18) == []
    delays(route, px4_types.VehicleStatus(timestamp=5_000_000).encode(), 10**18)
    (found,) = delays.delays(10**18)
    assert not found.is_in_sync


def test_topics_of_unknown_messages_have_no_delay(px4_types: Any) -> None:
    delays = Delays(lambda _: None)
    delays(Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000), b"\0\1\0\0", 1)
    assert delays.delays(2) == []
    assert offsets_of(px4_types.VehicleStatus) == (("timestamp", 4),)


def test_samples_of_earlier_windows_and_damaged_ones_are_not_kept(px4_types: Any) -> None:
    route = next(route for route in routes_of(px4_types) if route.name == STATUS)
    delays = Delays(lambda _: px4_types.VehicleStatus, window=2.0)
    for number in range(100):
        delays(route, px4_types.VehicleStatus(timestamp=10**15).encode(), 10**18 + number * SECOND)
        delays(route, b"\0\1\0\0\1", 10**18 + number * SECOND)
    assert {len(samples) for samples in delays._samples.values()} == {3}
