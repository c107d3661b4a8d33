"""Tests of watches: all samples of a vehicle, undecoded."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from msggen.link.link import Route
from msggen.live import FormatError, NotConnectedError, TopicError, Vehicle
from support.fake_link import FakeLink


def test_a_watch_gets_every_sample_also_of_unknown_topics(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    unknown = Route("/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4000)
    status, attitude = px4_types.VehicleStatus(timestamp=1), px4_types.VehicleAttitude(timestamp=2)
    seen: list[tuple[str, bytes, int]] = []
    with Vehicle(link) as vehicle:
        early = link.connect()
        watch = vehicle.watch(lambda route, payload, time: seen.append((route.name, payload, time)))
        link.open(early, unknown)
        link.sample(early, status, when=11)
        link.user().sample(early, unknown, b"\0\1\0\0xyz", 12)
        link.disconnect(early)
        later = link.connect()
        link.sample(later, attitude, when=13)
        watch.close()
        link.sample(later, status, when=14)
    assert seen == [
        ("/fmu/out/vehicle_status_v4", status.encode(), 11),
        ("/fmu/out/mine", b"\0\1\0\0xyz", 12),
        ("/fmu/out/vehicle_attitude", attitude.encode(), 13),
    ]


def test_watches_and_subscriptions_stand_side_by_side(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    status = px4_types.VehicleStatus(timestamp=1)
    counts = [0, 0]

    def count(number: int) -> None:
        counts[number] += 1

    with Vehicle(link) as vehicle, Vehicle(link, px4_types) as other:
        remote = link.connect()
        subscription = vehicle.subscribe(px4_types.VehicleStatus)
        first = vehicle.watch(lambda *_: count(0))
        other.watch(lambda *_: count(1))
        link.sample(remote, status)
        first.close()
        first.close()
        link.sample(remote, status)
        assert subscription.received == 2
    assert counts == [1, 2]


def test_errors_of_a_watcher_are_counted_and_told(px4_types: Any, caplog: pytest.LogCaptureFixture) -> None:
    link = FakeLink(px4_types)

    def fail(*_: object) -> None:
        raise SystemExit("no")

    with Vehicle(link) as vehicle, caplog.at_level(logging.ERROR):
        watch = vehicle.watch(fail)
        remote = link.connect()
        for _ in range(3):
            link.sample(remote, px4_types.VehicleStatus())
        assert watch.errors == 3
    assert [record.getMessage() for record in caplog.records] == [
        "error 1 in a watcher, for a sample of '/fmu/out/vehicle_status_v4', which is still called"
    ]
    with pytest.raises(NotConnectedError, match="closed"):
        vehicle.watch(fail)


def test_a_sample_of_a_watch_can_be_decoded(px4_types: Any) -> None:
    link = FakeLink(px4_types)
    status = px4_types.VehicleStatus(nav_state=4)
    seen: list[tuple[Route, bytes]] = []
    with Vehicle(link, px4_types) as vehicle:
        remote = link.connect(namespace="uav_1")
        vehicle.watch(lambda route, payload, _: seen.append((route, payload)))
        link.sample(remote, status)
        ((route, payload),) = seen
        assert vehicle.decode(route, payload) == status
        with pytest.raises(TopicError, match="no endpoint '/uav_1/fmu/out/mine'"):
            vehicle.decode(route._replace(name="/uav_1/fmu/out/mine"), payload)
        with pytest.raises(FormatError, match="the vehicle has '/uav_1/fmu/out/vehicle_status_v9'"):
            vehicle.decode(route._replace(name="/uav_1/fmu/out/vehicle_status_v9"), payload)
        with pytest.raises(px4_types.DecodeError):
            vehicle.decode(route, payload[:10])
        link.answer(remote, {"vehicle_status": 0x1234})
        with pytest.raises(FormatError, match="has the hash 0x00001234"):
            vehicle.decode(route, payload)
        link.disconnect(remote)
        with pytest.raises(NotConnectedError):
            vehicle.decode(route, payload)
