"""Tests of subscriptions, with a link whose vehicle the test plays."""

from __future__ import annotations

import asyncio
import gc
import logging
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from msggen.live import LinkError, LinkTimeoutError, NotConnectedError, TopicError, Vehicle
from msggen.vehicle import subscription as subscription_module
from support.fake_link import FakeLink, routes_of

WAIT = 10.0
"""A bound in s that no test reaches."""


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


@pytest.fixture
def vehicle(link: FakeLink) -> Iterator[Vehicle]:
    with Vehicle(link) as vehicle:
        yield vehicle


def status(px4_types: Any, number: int) -> Any:
    return px4_types.VehicleStatus(timestamp=number, nav_state=number % 30)


def stamps(messages: Any) -> list[int]:
    return [message.timestamp for message in messages]


def test_a_subscription_yields_the_messages_in_order(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    sent = [status(px4_types, number) for number in range(5)]
    for message in sent:
        link.sample(remote, message)
    vehicle.close()
    assert list(subscription) == sent
    assert (subscription.received, subscription.dropped) == (5, 0)


@pytest.mark.parametrize(
    "name",
    [
        "vehicle_status",
        "vehicle_status_v4",
        "/fmu/out/vehicle_status",
        "/fmu/out/vehicle_status_v4",
        "rt/fmu/out/vehicle_status_v4",
        "/uav_1/fmu/out/vehicle_status_v4",
    ],
)
def test_a_topic_is_found_by_any_of_its_names(link: FakeLink, px4_types: Any, name: str) -> None:
    with Vehicle(link, px4_types) as vehicle:
        subscription = vehicle.subscribe(name)
        remote = link.connect(namespace="uav_1")
        link.sample(remote, status(px4_types, 3))
        assert subscription.latest() == status(px4_types, 3)


@pytest.mark.parametrize("name", ["vehicle_status_v9", "/uav_1/fmu/out/vehicle_status_v1"])
def test_a_version_that_the_types_do_not_have_is_an_error(link: FakeLink, px4_types: Any, name: str) -> None:
    error = (
        f"px4_types has no version {name[-1]} of '/fmu/out/vehicle_status', but 4: leave the version out of the name"
    )
    with Vehicle(link, px4_types) as vehicle, pytest.raises(TopicError, match=error):
        vehicle.subscribe(name)


def test_a_version_to_the_vehicle_that_the_types_do_not_have_is_an_error(link: FakeLink, px4_types: Any) -> None:
    with Vehicle(link, px4_types) as vehicle:
        link.connect()
        with pytest.raises(TopicError, match="has no version 9 of '/fmu/in/trajectory_setpoint', but 0"):
            vehicle.publish(px4_types.TrajectorySetpoint(), "trajectory_setpoint_v9")


def test_a_topic_is_found_by_its_endpoint(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect(namespace="uav_1")
    endpoints = px4_types.topics.out.vehicle_status, px4_types.topics.namespaced("uav_1").out.vehicle_status
    found = [vehicle.subscribe(endpoint) for endpoint in endpoints]
    other = vehicle.subscribe(px4_types.topics.namespaced("uav_2").out.vehicle_status)
    link.sample(remote, status(px4_types, 3))
    assert [len(each) for each in found] == [1, 1]
    assert len(other) == 0


@pytest.mark.parametrize(
    ("topic", "error"),
    [
        ("vehicle_statu", "no endpoint 'vehicle_statu', did you mean '/fmu/out/vehicle_status_v4'?"),
        (
            "/fmu/out/vehicle_statsu",
            "no endpoint '/fmu/out/vehicle_statsu', did you mean '/fmu/out/vehicle_status_v4'?",
        ),
        (
            "esc_status",
            "no endpoint 'esc_status': 'esc_status' is a uORB topic that does not cross the bridge: it is not in dds_t",
        ),
        ("vehicle_command", "'/fmu/in/vehicle_command' is read by PX4: use publish, or name a topic of '/fmu/out'"),
        (
            "TrajectorySetpoint",
            "'/fmu/in/trajectory_setpoint' is read by PX4: use publish, or name a topic of '/fmu/out'",
        ),
        ("EscStatus", "no endpoint for EscStatus: its topic is not in the dds_topics.yaml of px4_types"),
    ],
)
def test_a_topic_that_cannot_be_subscribed_names_the_cure(
    link: FakeLink, px4_types: Any, topic: str, error: str
) -> None:
    with Vehicle(link, px4_types) as vehicle, pytest.raises(TopicError) as raised:
        vehicle.subscribe(getattr(px4_types, topic) if topic[0].isupper() else topic)
    assert str(raised.value).startswith(error)


def test_a_name_needs_a_package(vehicle: Vehicle) -> None:
    with pytest.raises(TopicError, match="is only a name: give the generated package"):
        vehicle.subscribe("vehicle_status")


def test_something_else_than_a_package_is_refused(link: FakeLink) -> None:
    with pytest.raises(TypeError, match="expected a generated package such as px4_types, got asyncio"):
        Vehicle(link, asyncio)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"url": 8888}, "expected an address such as 'udp://127.0.0.1:8888', or a Link, got 8888"),
        ({"key": "1"}, r"expected a key from 1 to 4294967295 \(UXRCE_DDS_KEY\), got '1'"),
        ({"key": 0}, "expected a key from 1 to 4294967295"),
        ({"queue": "10"}, "expected a queue of 1 sample or more, got '10'"),
        ({"types": "px4_types"}, "expected a generated package such as px4_types, got 'px4_types'"),
    ],
)
def test_a_wrong_argument_is_named(link: FakeLink, arguments: dict[str, Any], error: str) -> None:
    with pytest.raises((TypeError, ValueError), match=error):
        Vehicle(**{"url": link, **arguments})


def test_a_callback_is_a_function(vehicle: Vehicle, px4_types: Any) -> None:
    with pytest.raises(TypeError, match="expected a function as callback, got 5: the size of the queue is queue="):
        vehicle.subscribe(px4_types.VehicleStatus, 5)  # type: ignore[call-overload]


def test_a_full_queue_drops_the_oldest_and_counts_it(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus, queue=3)
    remote = link.connect()
    for number in range(10):
        link.sample(remote, status(px4_types, number))
    vehicle.close()
    assert stamps(subscription) == [7, 8, 9]
    assert (subscription.received, subscription.dropped) == (10, 7)


def test_an_iterator_waits_for_the_next_message(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    seen: list[int] = []
    arrived = threading.Semaphore(0)

    def read() -> None:
        for message in subscription:
            seen.append(message.timestamp)
            arrived.release()

    thread = threading.Thread(target=read)
    thread.start()
    for number in range(50):
        link.sample(remote, status(px4_types, number))
        assert arrived.acquire(timeout=WAIT)
    subscription.close()
    thread.join(WAIT)
    assert not thread.is_alive()
    assert seen == list(range(50))


def test_timed_gives_the_time_of_arrival(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    raw = vehicle.subscribe(px4_types.VehicleStatus, raw=True)
    remote = link.connect()
    link.sample(remote, status(px4_types, 1), when=123)
    assert next(iter(subscription.timed())) == (status(px4_types, 1), 123)
    assert next(iter(raw.timed())) == (status(px4_types, 1).encode(), 123)


def test_a_callback_gets_each_message_and_its_errors_are_told(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[int] = []

    def callback(message: Any) -> None:
        seen.append(message.timestamp)
        if message.timestamp % 2:
            raise ZeroDivisionError("odd")

    subscription = vehicle.subscribe(px4_types.VehicleStatus, callback)
    remote = link.connect()
    for number in range(8):
        link.sample(remote, status(px4_types, number))
    assert seen == list(range(8))
    assert subscription.callback_errors == 4
    told = [record for record in caplog.records if record.levelno >= logging.ERROR]
    assert [record.getMessage() for record in told] == [
        "error 1 in the callback of '/fmu/out/vehicle_status', which is still called"
    ]
    assert "ZeroDivisionError: odd" in caplog.text
    with pytest.raises(TopicError, match="a subscription with a callback has no queue"):
        next(iter(subscription))


def test_a_callback_that_exits_does_not_end_the_link(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus, lambda _: sys.exit("done"))
    remote = link.connect()
    for number in range(2):
        link.sample(remote, status(px4_types, number))
    assert subscription.callback_errors == 2
    assert "SystemExit: done" in caplog.text


def test_a_subscription_of_a_vehicle_that_another_thread_closes_ends(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vehicle, "_check_open", vehicle.close)  # just after the check
    assert link.starts == 1
    assert list(vehicle.subscribe(px4_types.VehicleStatus)) == []


def test_a_callback_may_close_its_vehicle(link: FakeLink, px4_types: Any) -> None:
    vehicle = Vehicle(link)
    vehicle.subscribe(px4_types.VehicleStatus, lambda _: vehicle.close())
    remote = link.connect()
    link.sample(remote, status(px4_types, 1))
    assert link.closed.wait(WAIT)


def test_a_sample_that_cannot_be_decoded_is_counted_and_told_once(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    for payload in (b"", b"\0\1\0\0", status(px4_types, 7).encode(), b"\0\1\0\0abc"):
        link.sample(remote, payload, "/fmu/out/vehicle_status")
    vehicle.close()
    assert stamps(subscription) == [7]
    assert subscription.undecodable == 3
    (told,) = [text for text in caplog.messages if "cannot be decoded" in text]
    assert told.startswith(
        "a sample of '/fmu/out/vehicle_status' cannot be decoded, and further ones are only counted: "
    )


def test_latest_is_the_newest_and_stays(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    assert subscription.latest() is None
    remote = link.connect()
    for number in range(3):
        link.sample(remote, status(px4_types, number))
    newest = subscription.latest()
    assert newest is not None
    assert newest.timestamp == 2
    assert subscription.latest() is newest
    assert len(subscription) == 3


WAITS = {
    "iterator": lambda subscription: next(iter(subscription)),
    "wait_for": lambda subscription: subscription.wait_for(lambda _: True),
    "asyncio": lambda subscription: asyncio.run(anext(aiter(subscription))),
}


@pytest.mark.parametrize("wait", WAITS.values(), ids=WAITS)
def test_who_waits_for_samples_without_a_vehicle_is_told_once_what_to_check(
    wait: Any, link: FakeLink, px4_types: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subscription_module, "PATIENCE", 0.01)
    vehicle, found = Vehicle(link), []
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    thread = threading.Thread(target=lambda: found.append(wait(subscription)), daemon=True)
    thread.start()
    while "check that uxrce_dds_client runs on the vehicle" not in caplog.text and thread.is_alive():
        thread.join(0.01)
    remote = link.connect()
    while thread.is_alive():
        link.sample(remote, status(px4_types, 1))
        thread.join(0.01)
    vehicle._tell_absence()
    vehicle.close()
    assert stamps(found) == [1]
    assert [record.levelname for record in caplog.records if "no vehicle" in record.message] == ["WARNING"]


def test_who_waits_for_samples_of_a_connected_vehicle_is_not_told(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subscription_module, "PATIENCE", 0.0)
    remote = link.connect()
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    timer = threading.Timer(0.5, lambda: link.sample(remote, status(px4_types, 1)))
    timer.start()
    assert next(iter(subscription)).timestamp == 1
    assert "no vehicle" not in caplog.text


def test_wait_for_returns_the_newest_or_a_later_message(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    for number in (1, 2):
        link.sample(remote, status(px4_types, number))
    assert subscription.wait_for(lambda message: message.timestamp == 2, WAIT).timestamp == 2
    with pytest.raises(LinkTimeoutError, match=r"no new sample of '/fmu/out/vehicle_status' arrived within 0\.01 s"):
        subscription.wait_for(lambda message: message.timestamp == 1, 0.01)
    asked = threading.Event()

    def is_five(message: Any) -> bool:
        asked.set()
        return bool(message.timestamp == 5)

    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(subscription.wait_for(is_five, WAIT)))
    thread.start()
    assert asked.wait(WAIT)
    for number in (3, 4, 5, 6):
        link.sample(remote, status(px4_types, number))
    thread.join(WAIT)
    assert stamps(found) == [5]
    assert len(subscription) == 6


def test_wait_for_ends_in_time_although_samples_arrive_all_the_time(
    link: FakeLink, vehicle: Vehicle, px4_types: Any
) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    link.sample(remote, status(px4_types, 2))
    with pytest.raises(
        LinkTimeoutError, match=r"none of \d+ samples of '/fmu/out/vehicle_status' met the condition within 0"
    ):
        subscription.wait_for(lambda _: link.sample(remote, status(px4_types, 2)), 0.05)


def test_wait_for_ends_when_the_subscription_is_closed(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    link.sample(remote, status(px4_types, 0))
    asked = threading.Event()
    errors: list[Exception] = []

    def wait() -> None:
        try:
            subscription.wait_for(lambda _: asked.set(), WAIT)
        except TopicError as error:
            errors.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    assert asked.wait(WAIT)
    subscription.close()
    thread.join(WAIT)
    assert [str(error) for error in errors] == ["the subscription of '/fmu/out/vehicle_status' was closed"]


def test_the_newest_message_is_decoded_once(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    link.sample(link.connect(), b"\0\1\0\0", "/fmu/out/vehicle_status")
    assert [subscription.latest(), subscription.latest()] == [None, None]
    assert subscription.undecodable == 1


def test_what_has_arrived_is_yielded_without_waiting(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    assert list(subscription.arrived()) == []
    remote = link.connect()
    for number in (1, 2):
        link.sample(remote, status(px4_types, number), when=10 + number)
    link.sample(remote, b"\0\1\0\0", "/fmu/out/vehicle_status")
    found = []
    for message, arrival in subscription.arrived():
        found.append((message.timestamp, arrival))
        link.sample(remote, status(px4_types, 9))  # for the next time
    assert (found, len(subscription)) == ([(1, 11), (2, 12)], 2)
    link.user().failed("the link failed")
    with pytest.raises(LinkError, match="the link failed"):
        list(subscription.arrived())


def test_drain_returns_an_array_and_empties_the_queue(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    assert subscription.drain().shape == (0,)
    remote = link.connect()
    for number in range(4):
        link.sample(remote, status(px4_types, number))
    link.sample(remote, b"\0\1\0\0", "/fmu/out/vehicle_status")
    assert subscription.drain()["timestamp"].tolist() == [0, 1, 2, 3]
    assert (len(subscription), subscription.undecodable) == (0, 1)


def test_an_async_iterator_needs_no_thread(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    threads = set(threading.enumerate())

    def send() -> None:
        for number in range(200):
            link.sample(remote, status(px4_types, number))

    async def read() -> list[int]:
        seen: list[int] = []
        sender = threading.Thread(target=send)
        async for message in subscription:
            seen.append(message.timestamp)
            if len(seen) == 1:
                sender.start()  # while the loop waits
            if len(seen) == 201:
                break
        assert {*threading.enumerate()} <= threads | {sender}
        return seen

    link.sample(remote, status(px4_types, 1000))
    assert asyncio.run(asyncio.wait_for(read(), WAIT)) == [1000, *range(200)]


def test_an_async_iterator_leaves_time_to_other_tasks(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    for number in range(300):
        link.sample(remote, status(px4_types, number))

    async def main() -> int:
        turns = 0

        async def other() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        task = asyncio.get_running_loop().create_task(other())
        seen = 0
        async for _ in subscription:
            seen += 1
            if seen == 300:
                break
        task.cancel()
        return turns

    assert asyncio.run(main()) >= 4


def test_an_async_iterator_ends_when_the_vehicle_is_closed(vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)

    async def read() -> int:
        asyncio.get_running_loop().call_later(0.01, vehicle.close)
        return len([message async for message in subscription])

    assert asyncio.run(asyncio.wait_for(read(), WAIT)) == 0


def test_subscriptions_go_on_when_the_vehicle_connects_again(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    for number in range(3):
        remote = link.connect(address=f"127.0.0.1:{40000 + number}")
        assert vehicle.is_connected
        link.sample(remote, status(px4_types, number))
        link.disconnect(remote)
        assert vehicle.wait_disconnected(WAIT) == "no answer for 3 s"
        with pytest.raises(NotConnectedError, match=r"\(key 1\) disconnected: no answer for 3 s; wait_connected"):
            _ = vehicle.remote
    vehicle.close()
    assert stamps(subscription) == [0, 1, 2]


def test_a_closed_vehicle_takes_no_subscription(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    vehicle.close()
    vehicle.close()
    with pytest.raises(NotConnectedError, match="the Vehicle is closed"):
        vehicle.subscribe(px4_types.VehicleStatus)
    assert link.closed.is_set()


def test_a_forgotten_vehicle_closes_its_link(link: FakeLink, px4_types: Any) -> None:
    vehicle = Vehicle(link)
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    del vehicle
    gc.collect()
    assert not link.closed.wait(0.02), "a subscription keeps its vehicle"
    del subscription
    gc.collect()
    assert link.closed.wait(WAIT)


def test_a_forgotten_subscription_ends(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect()
    seen: list[Any] = []
    vehicle.subscribe(px4_types.VehicleStatus, seen.append)
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    assert len(vehicle._member.feeds) == 2
    del subscription
    gc.collect()
    assert len(vehicle._member.feeds) == 1, "the one with a callback goes on"
    link.sample(remote, status(px4_types, 1))
    assert stamps(seen) == [1]


def test_a_topic_that_the_vehicle_does_not_have_is_told(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    vehicle.subscribe(px4_types.VehicleStatus, print)
    attitude = [each for each in routes_of(px4_types) if "vehicle_attitude" in each.name]
    remote = link.connect(routes=attitude)
    second = 10**9
    for number in range(6):
        link.sample(remote, px4_types.VehicleAttitude(), when=number * second)
    text = "the vehicle at 127.0.0.1:40000 (key 1) has no topic '/fmu/out/vehicle_status'"
    assert [each for each in caplog.messages if "has no topic" in each] == [
        f"{text}: it is not in the dds_topics.yaml of its firmware"
    ]


@pytest.mark.parametrize(
    ("remote", "why"),
    [
        ({"namespace": "uav_1"}, "its namespace is 'uav_1'"),
        ({}, "it has no namespace"),
    ],
)
def test_a_topic_in_another_namespace_is_told(
    remote: dict[str, Any], why: str, link: FakeLink, px4_types: Any, caplog: Any
) -> None:
    with Vehicle(link, px4_types) as vehicle:
        vehicle.subscribe("/uav_2/fmu/out/vehicle_status", print)
        attitude = [each for each in routes_of(px4_types) if "vehicle_attitude" in each.name]
        found = link.connect(**remote, routes=attitude)
        for number in range(6):
            link.sample(found, px4_types.VehicleAttitude(), when=number * 10**9)
        (told,) = [each for each in caplog.messages if "has no topic" in each]
        assert f" has no topic '/uav_2/fmu/out/vehicle_status': {why}" in told
        with pytest.raises(TopicError, match=f"does not read '/uav_2/fmu/in/trajectory_setpoint': {why}"):
            vehicle.publish(px4_types.TrajectorySetpoint(), "/uav_2/fmu/in/trajectory_setpoint")


def test_a_wait_leaves_nothing_behind(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    iterator: Any = iter(subscription)
    for number in range(3):
        timer = threading.Timer(0.01, link.sample, (remote, status(px4_types, number)))
        timer.start()
        assert next(iterator).timestamp == number
        timer.join()
        with pytest.raises(LinkTimeoutError):
            subscription.wait_for(lambda _: False, 0.001)
        subscription.wait_for(lambda _: True, WAIT)

    async def read() -> None:
        reader = subscription.__aiter__()
        asyncio.get_running_loop().call_later(0.01, link.sample, remote, status(px4_types, 4))
        await reader.__anext__()
        await reader.aclose()  # type: ignore[attr-defined]

    asyncio.run(read())
    iterator.close()
    assert subscription._feed._wakers == ()
    assert vehicle._member.feeds == (subscription._feed,)


def test_a_reader_is_not_late(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    """A sample between the last look at the queue and the wait wakes the reader; otherwise this takes minutes."""
    subscription = vehicle.subscribe(px4_types.VehicleStatus)
    remote = link.connect()
    payload = status(px4_types, 1).encode()
    go, count = threading.Semaphore(0), 300

    def send() -> None:
        for _ in range(count):
            go.acquire()
            link.sample(remote, payload, "/fmu/out/vehicle_status")

    thread = threading.Thread(target=send)
    thread.start()
    iterator = iter(subscription)
    for _ in range(count):
        go.release()
        next(iterator)
    thread.join()
    assert subscription.received == count
