"""Tests of the firmware of a vehicle: which release it is, and what happens with topics that differ."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.link.link import Route, StaleError
from msggen.live import FormatError, TopicError, Vehicle
from msggen.messages.firmware import PROTOCOL_VERSION, REQUEST, RESPONSE, FormatCheck, identify, releases
from msggen.messages.names import is_topic, stem_of, version_of, without_namespace
from msggen.sources.embedded import EMBEDDED
from support.fake_link import FakeLink, routes_of
from support.live_releases import TABLE, table


@pytest.fixture(scope="module")
def archived() -> dict[str, Any]:
    """A package of each release, with archived versions where it has them."""
    return {release: package_of(release) for release in ("v1.18", "v1.17", "v1.15")}


def known(release: str, namespace: str = "") -> list[Route]:
    """Return the routes of a vehicle with an embedded release."""
    front = f"/{namespace}" if namespace else ""
    return [
        Route(front + name, f"px4_msgs/msg/{row.message}", "in" if "/in/" in name else "out", row.object_id)
        for name, row in releases()[release].items()
    ]


def hashes(release: str) -> dict[str, int]:
    return {f"px4_msgs/msg/{row.message}": row.message_hash for row in releases()[release].values()}


def test_the_table_of_releases_is_current() -> None:
    assert TABLE.read_text() == table(), "run `python tests/support/live_releases.py` and commit what it wrote"


def test_the_names_of_topics() -> None:
    assert stem_of("/uav_1/fmu/out/vehicle_status_v12") == "/uav_1/fmu/out/vehicle_status"
    assert [version_of(name) for name in ("/a/b_v2", "/a/b", "/a/b_v", "/a/v1")] == [2, 0, 0, 0]
    assert is_topic("/uav_1/fmu/out/a_v2", "/fmu/out/a")
    assert is_topic("/uav_1/fmu/out/a_v2", "/fmu/out/a", "uav_1")
    assert not is_topic("/uav_1/fmu/out/a_v2", "/fmu/out/a", "uav")
    assert not is_topic("/fmu/out/a", "/fmu/out/a", "uav")
    assert not is_topic("/fmu/out/ba", "/a")
    assert without_namespace("/uav_1/fmu/out/a", "uav_1") == "/fmu/out/a"
    assert without_namespace("/uav_10/fmu/out/a", "uav_1") == "/uav_10/fmu/out/a"


@pytest.mark.parametrize("namespace", ["", "uav_1"])
@pytest.mark.parametrize("release", EMBEDDED)
def test_each_release_is_recognized(release: str, namespace: str) -> None:
    routes = known(release, namespace)
    without_ids = [route._replace(object_id=-1) for route in routes]
    for given, answers in ((routes, {}), (routes, hashes(release)), (without_ids, hashes(release)), (without_ids, {})):
        firmware = identify(given, answers, namespace)
        assert (firmware.release, str(firmware)) == (release, release)


def test_differences_are_named() -> None:
    changed = {**hashes("v1.17"), "px4_msgs/msg/VehicleStatus": 1, "px4_msgs/msg/SensorCombined": 2}
    own = Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 400)
    routes = [route for route in known("v1.17") if "odometry" not in route.name]
    firmware = identify([*routes, own], changed)
    text = "v1.17; 2 messages differ: SensorCombined, VehicleStatus; 1 further topic: /fmu/out/mine"
    assert str(firmware) == text
    assert [name for name in firmware.missing if "odometry" not in name] == []
    assert len(firmware.missing) == 3
    versioned = [
        route._replace(name="/fmu/out/vehicle_status_v9") if "out/vehicle_status" in route.name else route
        for route in known("v1.17")
    ]
    assert str(identify(versioned, hashes("v1.17"))) == "v1.17; 1 message differs: VehicleStatus"
    assert str(identify([own], {})) == "unknown firmware"
    assert str(identify([], {})) == "unknown firmware"


def test_the_requests_are_those_of_the_generated_package(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        remote = link.connect(namespace="uav_1")
        link.sample(remote, px4_types.VehicleStatus())
        first = px4_types.MessageFormatRequest.decode(link.published[0][2])
        assert first.protocol_version == PROTOCOL_VERSION == px4_types.MessageFormatRequest.LATEST_PROTOCOL_VERSION
        assert len(link.published) == 1, "one request at a time"
        asked = link.answer(remote)
        expected = {each.format_request_name for each in px4_types.topics.ENDPOINTS}
        types = {each.message for each in px4_types.topics.ENDPOINTS}
        assert {*asked} <= expected
        assert len(asked) == len(types)
        firmware = vehicle.wait_firmware(1)
        assert (str(firmware), firmware.is_complete) == ("v1.18", True)
        assert firmware.hashes == {cls.__msg__.ros_type: cls.__msg__.message_hash for cls in types}


def test_the_subscribed_types_are_asked_for_first(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        subscriptions = [vehicle.subscribe(px4_types.VehicleLandDetected)]
        remote = link.connect()
        subscriptions.append(vehicle.subscribe(px4_types.VehicleAttitude))
        link.sample(remote, px4_types.VehicleStatus())
        subscriptions.append(vehicle.subscribe(px4_types.VehicleStatus))
        assert [name.rpartition("/")[2] for name in link.answer(remote)][:3] == [
            "vehicle_land_detected",
            "vehicle_status",
            "vehicle_attitude",
        ]


def test_a_request_without_an_answer_is_repeated_and_then_left_out(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        routes = [route for route in routes_of(px4_types) if route.name in (REQUEST, RESPONSE)]
        status = next(route for route in routes_of(px4_types) if "out/vehicle_status" in route.name)
        remote = link.connect(routes=[status, *routes])
        step = 10**8
        for number in range(100):
            link.sample(remote, px4_types.VehicleStatus(), when=number * step)
        assert len(link.published) == 3 * 4
        assert vehicle.firmware.is_complete
        assert vehicle.firmware.hashes == {}


def test_a_request_is_repeated_after_the_clock_was_set_back(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link):
        remote = link.connect()
        hour = 3600 * 10**9
        for when in (10 * hour, 10 * hour + 1, hour, hour + 1, hour + 10**9):
            link.sample(remote, px4_types.VehicleStatus(), when=when)
        assert len(link.published) == 3


def test_answers_that_nobody_asked_for_are_ignored(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        subscription = vehicle.subscribe(px4_types.VehicleStatus)
        remote = link.connect()
        names = b"/fmu/out/vehicle_status", b"/fmu/out/vehicle_statu", b"\xff" * 50
        early, *others = (
            px4_types.MessageFormatResponse(topic_name=name.ljust(50, b"\0"), success=True) for name in names
        )
        link.sample(remote, early)
        for other in (*others, b"\0\1\0\0", b""):
            link.sample(remote, other, RESPONSE)
        link.sample(remote, px4_types.VehicleStatus(timestamp=1))
        assert subscription.received == 1
        assert vehicle.firmware.hashes == {}


def test_a_topic_that_differs_raises_from_the_iterator_and_ends_callbacks(
    px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        seen: list[Any] = []
        subscription = vehicle.subscribe(px4_types.VehicleStatus)
        vehicle.subscribe(px4_types.VehicleStatus, seen.append)
        raw = vehicle.subscribe(px4_types.VehicleStatus, raw=True)
        attitude = vehicle.subscribe(px4_types.VehicleAttitude)
        remote = link.connect()
        link.sample(remote, px4_types.VehicleStatus(timestamp=1))
        link.answer(remote, {"vehicle_status": 0x1234})
        link.sample(remote, px4_types.VehicleStatus(timestamp=2))
        link.sample(remote, px4_types.VehicleAttitude(timestamp=3))
        own = px4_types.VehicleStatus.__msg__.message_hash
        text = (
            "the vehicle's definition of '/fmu/out/vehicle_status_v4' has the hash 0x00001234, and "
            f"px4_types.VehicleStatus has {own:#010x}: "
            "build types of the vehicle's own firmware, msggen build --px4 PX4-Autopilot"
        )
        for read in (lambda: next(iter(subscription)), subscription.latest, subscription.drain):
            with pytest.raises(FormatError) as raised:
                read()
            assert str(raised.value) == text
        assert [message.timestamp for message in seen] == [1]
        assert caplog.messages == [f"the callback of '/fmu/out/vehicle_status' is no longer called: {text}"]
        assert attitude.latest() == px4_types.VehicleAttitude(timestamp=3)
        assert len(raw) == 2, "bytes have no definition"
        assert str(vehicle.firmware) == "v1.18; 1 message differs: VehicleStatus"
        # another firmware makes it right
        link.disconnect(remote)
        again = link.connect(address="127.0.0.1:50000")
        link.sample(again, px4_types.VehicleStatus(timestamp=4))
        assert subscription.latest() == px4_types.VehicleStatus(timestamp=4)


def test_publishing_a_message_that_differs_raises(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    with Vehicle(link) as vehicle:
        remote = link.connect()
        vehicle.publish(px4_types.TrajectorySetpoint())
        link.sample(remote, px4_types.VehicleStatus())
        link.answer(remote, {"trajectory_setpoint": 5})
        with pytest.raises(
            FormatError, match=r"'/fmu/in/trajectory_setpoint' has the hash 0x00000005, and px4_types.Tr"
        ):
            vehicle.publish(px4_types.TrajectorySetpoint())


def test_another_version_is_refused_by_default(archived: dict[str, Any]) -> None:
    new, old = archived["v1.18"], archived["v1.17"]
    link = FakeLink(old)
    with Vehicle(link) as vehicle:
        subscription = vehicle.subscribe(new.VehicleStatus)
        remote = link.connect()
        link.sample(remote, old.VehicleStatus(timestamp=1))
        ros_name = old.topics.out.vehicle_status.ros_name
        version = version_of(ros_name)
        with pytest.raises(FormatError) as raised:
            next(iter(subscription))
        assert str(raised.value) == (
            f"the vehicle has '{ros_name}', and VehicleStatus is version 4: "
            f"subscribe to VehicleStatusV{version}, or with convert=True"
        )
        by_class = vehicle.subscribe(getattr(new, f"VehicleStatusV{version}"))
        link.sample(remote, old.VehicleStatus(timestamp=2))
        assert by_class.latest() == getattr(new, f"VehicleStatusV{version}")(timestamp=2)


def test_another_version_is_converted_or_decoded_by_name(archived: dict[str, Any]) -> None:
    new, old = archived["v1.18"], archived["v1.17"]
    link = FakeLink(old)
    with Vehicle(link, new) as vehicle:
        converted = vehicle.subscribe(new.VehicleStatus, convert=True)
        by_name = vehicle.subscribe("vehicle_status")
        remote = link.connect()
        link.sample(remote, old.VehicleStatus(timestamp=1, system_id=7))
        link.answer(remote)
        link.sample(remote, old.VehicleStatus(timestamp=2, system_id=7))
        message: Any = converted.latest()
        assert (type(message), message.timestamp, message.system_id) == (new.VehicleStatus, 2, 7)
        message = by_name.latest()
        assert (message.__msg__.message_hash, message.timestamp) == (old.VehicleStatus.__msg__.message_hash, 2)
        assert converted.drain()["timestamp"].tolist() == [1, 2]


def test_a_name_with_a_version_means_that_version(archived: dict[str, Any]) -> None:
    new, old = archived["v1.18"], archived["v1.17"]
    version = old.VehicleStatus.__msg__.message_version
    link = FakeLink(old)
    with Vehicle(link, new) as vehicle:
        right = vehicle.subscribe(f"/fmu/out/vehicle_status_v{version}")
        converted = vehicle.subscribe("vehicle_status_v4", convert=True)
        wrong = vehicle.subscribe("vehicle_status_v4")
        link.sample(link.connect(), old.VehicleStatus(timestamp=1))
        assert right.latest() == getattr(new, f"VehicleStatusV{version}")(timestamp=1)
        assert type(converted.latest()) is new.VehicleStatus
        with pytest.raises(FormatError, match="and VehicleStatus is version 4"):
            wrong.latest()


def test_another_package_decodes_what_differs(archived: dict[str, Any], px4_types: Any) -> None:
    old = archived["v1.17"]
    link = FakeLink(old)
    with Vehicle(link, (px4_types, old)) as vehicle:
        subscription = vehicle.subscribe(px4_types.VehicleStatus)
        gps = vehicle.subscribe(px4_types.SensorCombined)
        remote = link.connect()
        link.sample(remote, old.VehicleStatus(timestamp=1))
        link.answer(remote)
        link.sample(remote, old.VehicleStatus(timestamp=2))
        link.sample(remote, old.SensorCombined(timestamp=2))
        assert [type(message) for message in (next(iter(subscription)), subscription.latest())] == [
            old.VehicleStatus
        ] * 2
        assert type(gps.latest()) is px4_types.SensorCombined
        assert str(vehicle.firmware) == "v1.17"


def test_converting_needs_archived_versions(px4_types: Any) -> None:
    with Vehicle(FakeLink(px4_types)) as vehicle, pytest.raises(TopicError, match="build px4_types with --archived"):
        vehicle.subscribe(px4_types.VehicleStatus, convert=True)


def test_a_release_that_does_not_answer_is_known_by_its_names(archived: dict[str, Any], px4_types: Any) -> None:
    """v1.14 has no message format requests: the hashes of the embedded release are those of the vehicle."""
    old = archived["v1.15"]
    link = FakeLink(old)
    with Vehicle(link, px4_types) as vehicle:
        odometry = vehicle.subscribe("vehicle_odometry")
        control = vehicle.subscribe("vehicle_control_mode")
        remote = link.connect(routes=known("v1.14"))
        for _ in range(2):
            link.sample(remote, b"\0\1\0\0", "/fmu/out/vehicle_odometry")
        assert str(vehicle.firmware) == "v1.14"
        assert vehicle.firmware.is_complete
        rows = {row.message: row.message_hash for row in releases()["v1.14"].values()}
        assert rows["VehicleOdometry"] == px4_types.VehicleOdometry.__msg__.message_hash
        assert rows["VehicleControlMode"] != px4_types.VehicleControlMode.__msg__.message_hash
        assert odometry.undecodable == 0
        with pytest.raises(FormatError, match="VehicleControlMode"):
            control.latest()


def test_a_line_that_is_full_just_now_does_not_end_the_questions() -> None:
    asked: list[bytes] = []

    def publish(_: Route, payload: bytes) -> None:
        asked.append(payload)
        if len(asked) == 1:
            raise StaleError("the line is too slow")

    check = FormatCheck(publish, lambda _: None)
    check.add([Route(REQUEST, "a/msg/A", "in", 1), Route(RESPONSE, "a/msg/B", "out", 2)], "")
    check.ask()
    assert not check.is_complete
    check.ask()
    assert len({*asked}) == 1 < len(asked)
