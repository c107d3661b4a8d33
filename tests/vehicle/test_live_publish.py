"""Tests of publishing, repeaters and calls, with a link whose vehicle the test plays."""

from __future__ import annotations

import gc
import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from msggen.live import LinkError, LinkTimeoutError, NotConnectedError, TopicError, Vehicle
from msggen.vehicle.calls import WAITING
from support.fake_link import SERVICE, FakeLink, routes_of

WAIT = 10.0


@pytest.fixture
def link(px4_types: Any) -> FakeLink:
    return FakeLink(px4_types)


@pytest.fixture
def vehicle(link: FakeLink) -> Iterator[Vehicle]:
    with Vehicle(link) as vehicle:
        yield vehicle


def sent(link: FakeLink) -> list[tuple[str, bytes]]:
    return [(route.name, payload) for _, route, payload in link.published]


def test_a_message_goes_to_the_topic_of_its_type(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect(namespace="uav_1")
    message = px4_types.TrajectorySetpoint(yaw=1.0)
    for _ in range(3):
        vehicle.publish(message)
    assert sent(link) == [("/uav_1/fmu/in/trajectory_setpoint", message.encode())] * 3


def test_a_topic_is_needed_where_several_have_the_type(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    message = px4_types.VehicleOdometry(timestamp=5)
    with pytest.raises(TopicError) as raised:
        vehicle.publish(message)
    names = "'/fmu/in/vehicle_mocap_odometry', '/fmu/in/vehicle_visual_odometry'"
    assert str(raised.value) == f"VehicleOdometry is the message of {names}: name one with topic="
    vehicle.publish(message, "vehicle_visual_odometry")
    vehicle.publish(message, px4_types.topics.in_.vehicle_mocap_odometry)
    assert [name for name, _ in sent(link)] == ["/fmu/in/vehicle_visual_odometry", "/fmu/in/vehicle_mocap_odometry"]


def test_the_topic_that_is_named_after_the_message_is_meant(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    vehicle.publish(px4_types.VehicleCommand())
    vehicle.publish(px4_types.VehicleCommand(), "vehicle_command_mode_executor")
    assert [name for name, _ in sent(link)] == ["/fmu/in/vehicle_command", "/fmu/in/vehicle_command_mode_executor"]


def test_a_class_is_no_message(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    text = r"got the class OffboardControlMode: call it to make one, OffboardControlMode\(\)"
    with pytest.raises(TypeError, match=text):
        vehicle.publish(px4_types.OffboardControlMode)
    with pytest.raises(TypeError, match=text):
        vehicle.every(10, px4_types.OffboardControlMode)
    with pytest.raises(TypeError, match="expected a message, got an object of type dict"):
        vehicle.publish({})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("message", "topic", "error"),
    [
        ("VehicleStatus", None, "'/fmu/out/vehicle_status_v4' is published by PX4: use subscribe"),
        (
            "VehicleCommand",
            "/fmu/out/vehicle_status",
            "'/fmu/out/vehicle_status_v4' is published by PX4: use subscribe",
        ),
        (
            "VehicleCommand",
            "trajectory_setpoint",
            "'/fmu/in/trajectory_setpoint' has messages of TrajectorySetpoint, not",
        ),
        (
            "VehicleCommand",
            "trajectory_setpont",
            "no endpoint 'trajectory_setpont', did you mean '/fmu/in/trajectory_s",
        ),
        ("EscStatus", None, "no endpoint for EscStatus: its topic is not in the dds_topics.yaml of px4_types"),
    ],
)
def test_a_message_that_does_not_fit_names_the_cure(
    link: FakeLink, px4_types: Any, message: str, topic: str | None, error: str
) -> None:
    with Vehicle(link) as vehicle:
        link.connect()
        with pytest.raises(TopicError) as raised:
            vehicle.publish(getattr(px4_types, message)(), topic)
    assert str(raised.value).startswith(error)
    assert link.published == []


def test_publishing_before_a_vehicle_connects_names_the_cure(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    with pytest.raises(NotConnectedError, match=r"no vehicle is connected to .* yet: call wait_connected\(\) first"):
        vehicle.publish(px4_types.TrajectorySetpoint())
    with pytest.raises(LinkTimeoutError, match=r"within 0.01 s: check that uxrce_dds_client runs on the vehicle"):
        vehicle.wait_connected(0.01)
    remote = link.connect(is_open=False)
    with pytest.raises(NotConnectedError, match=r"\(key 1\) is still connecting: call wait_connected"):
        vehicle.publish(px4_types.TrajectorySetpoint())
    for route in routes_of(px4_types):
        link.open(remote, route)
    assert not vehicle.is_connected
    link.open(remote, SERVICE)
    assert vehicle.wait_connected(0) == remote
    vehicle.publish(px4_types.TrajectorySetpoint())
    assert len(link.published) == 1


def test_a_vehicle_is_connected_once_its_topics_are_known(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """PX4 synchronizes its time for 5 s before it creates its topics, and has no service in v1.14."""
    remote = link.connect(is_open=False)
    monkeypatch.setattr("msggen.vehicle.entry.SETTLED_S", -1.0)
    assert not vehicle.is_connected
    link.open(remote, routes_of(px4_types)[0])
    assert vehicle.is_connected
    monkeypatch.setattr("msggen.vehicle.entry.SETTLED_S", 1000.0)
    assert not vehicle.is_connected
    link.user().sample(remote, routes_of(px4_types)[0], b"", 1)
    assert vehicle.is_connected


def test_a_topic_that_the_vehicle_lacks_names_the_cure(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect(routes=[route for route in routes_of(px4_types) if "trajectory" not in route.name])
    with pytest.raises(TopicError, match="does not read '/fmu/in/trajectory_setpoint'"):
        vehicle.publish(px4_types.TrajectorySetpoint())


def test_publishing_after_the_vehicle_left_raises(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect()
    vehicle.publish(px4_types.TrajectorySetpoint())
    link.opened.pop(remote.number)  # the link knows, and has not told yet
    with pytest.raises(LinkError, match="no longer connected"):
        vehicle.publish(px4_types.TrajectorySetpoint())


def test_a_message_that_cannot_be_encoded_raises(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    with pytest.raises(px4_types.EncodeError):
        vehicle.publish(px4_types.TrajectorySetpoint(position=(1.0,)))


def test_the_time_is_utc_in_microseconds(vehicle: Vehicle) -> None:
    before, found, after = time.time_ns() // 1000, vehicle.time, time.time_ns() // 1000
    assert before <= found <= after


def test_a_repeater_publishes_until_it_is_closed(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    message = px4_types.OffboardControlMode(position=True)
    repeater = vehicle.every(500, message)
    deadline = time.monotonic() + WAIT
    while len(link.published) < 10 and time.monotonic() < deadline:
        assert link.sent.wait(WAIT)
        link.sent.clear()
    repeater.close()
    count = len(link.published)
    assert not repeater.is_running
    jitter = repeater.jitter
    assert (jitter.sent, jitter.skipped) == (count, 0)
    assert 0 <= jitter.mean <= jitter.worst
    assert {*sent(link)} == {("/fmu/in/offboard_control_mode", message.encode())}


def test_a_repeater_sends_nothing_without_a_vehicle_and_goes_on_with_it(
    link: FakeLink, vehicle: Vehicle, px4_types: Any
) -> None:
    asked = threading.Semaphore(0)

    def message() -> Any:
        asked.release()
        return px4_types.OffboardControlMode()

    with vehicle.every(500, message) as repeater:
        for _ in range(3):
            assert asked.acquire(timeout=WAIT)
        assert link.published == []
        assert repeater.jitter.sent == 0
        remote = link.connect()
        assert link.sent.wait(WAIT)
        link.disconnect(remote)
    assert repeater.error is None
    assert repeater.jitter.skipped >= 2


def test_a_callable_may_send_nothing_or_end_the_repeater(
    link: FakeLink, vehicle: Vehicle, px4_types: Any, caplog: pytest.LogCaptureFixture
) -> None:
    link.connect()
    results: list[Any] = [None, px4_types.OffboardControlMode(), None]
    repeater = vehicle.every(1000, results.pop)
    deadline = time.monotonic() + WAIT
    while repeater.is_running and time.monotonic() < deadline:
        time.sleep(0.001)
    assert isinstance(repeater.error, IndexError)
    assert (repeater.jitter.sent, repeater.jitter.skipped) == (1, 2)
    assert [record.levelno for record in caplog.records if "a repeater" in record.getMessage()] == [logging.ERROR]


def test_a_repeater_refuses_what_it_cannot_do(vehicle: Vehicle, px4_types: Any) -> None:
    with pytest.raises(TopicError, match="is published by PX4"):
        vehicle.every(10, px4_types.VehicleStatus())
    with pytest.raises(ValueError, match="expected a rate above 0"):
        vehicle.every(0, px4_types.OffboardControlMode())
    assert not [thread for thread in threading.enumerate() if "every" in thread.name]


def test_forgetting_the_vehicle_ends_its_repeaters(link: FakeLink, px4_types: Any) -> None:
    vehicle = Vehicle(link)
    link.connect()
    repeater = vehicle.every(200, px4_types.OffboardControlMode())
    assert link.sent.wait(WAIT)
    del vehicle
    gc.collect()
    assert link.closed.wait(WAIT)
    repeater._thread.join(WAIT)
    assert (repeater.is_running, repeater.error) == (False, None)


def test_closing_the_vehicle_ends_its_repeaters(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    repeater = vehicle.every(100, px4_types.OffboardControlMode())
    assert link.sent.wait(WAIT)
    vehicle.close()
    assert not repeater.is_running
    assert repeater.error is None


# calls


class Call(threading.Thread):
    """A call in a thread of its own."""

    def __init__(self, vehicle: Vehicle, request: Any, timeout: float = WAIT) -> None:
        super().__init__()
        self.vehicle, self.request, self.timeout = vehicle, request, timeout
        self.reply: Any = None
        self.error: Exception | None = None
        self.start()

    def run(self) -> None:
        try:
            self.reply = self.vehicle.call(self.request, self.timeout)
        except LinkError as error:
            self.error = error

    def result(self) -> Any:
        self.join(WAIT)
        assert not self.is_alive()
        return self.error or self.reply


def answer(link: FakeLink, px4_types: Any, result: int) -> None:
    """Reply to the request that is on the wire, and wait for the next one no longer than needed."""
    assert link.called.wait(WAIT)
    link.called.clear()
    remote, service, number, _ = link.calls[-1]
    reply = px4_types.srv.VehicleCommand.Response(reply=px4_types.VehicleCommandAck(result=result))
    link.user().replied(remote, service, number, reply.encode())


def test_a_call_returns_the_reply(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    link.connect()
    request = px4_types.srv.VehicleCommand.Request(request=px4_types.VehicleCommand(command=400))
    call = Call(vehicle, request)
    answer(link, px4_types, 3)
    assert call.result() == px4_types.srv.VehicleCommand.Response(reply=px4_types.VehicleCommandAck(result=3))
    assert [payload for _, _, _, payload in link.calls] == [request.encode()]


def test_calls_of_several_threads_are_on_the_wire_one_at_a_time(
    link: FakeLink, vehicle: Vehicle, px4_types: Any
) -> None:
    link.connect()
    request = px4_types.srv.VehicleCommand.Request()
    calls = [Call(vehicle, request) for _ in range(5)]
    for number in range(5):
        assert link.called.wait(WAIT)
        assert len(link.calls) == number + 1
        answer(link, px4_types, number)
    assert sorted(call.result().reply.result for call in calls) == [0, 1, 2, 3, 4]
    assert len({number for _, _, number, _ in link.calls}) == 5


def test_a_late_reply_is_not_that_of_the_next_call(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect()
    request = px4_types.srv.VehicleCommand.Request()
    with pytest.raises(LinkTimeoutError, match=r"'/fmu/vehicle_command': no reply within 0\.01 s; PX4"):
        vehicle.call(request, 0.01)
    link.called.clear()
    call = Call(vehicle, request)
    assert link.called.wait(WAIT)
    late = px4_types.srv.VehicleCommand.Response(reply=px4_types.VehicleCommandAck(result=1))
    link.user().replied(remote, SERVICE, link.calls[0][2], late.encode())
    answer(link, px4_types, 2)
    assert call.result().reply.result == 2


def test_a_call_ends_when_the_vehicle_disconnects(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect()
    calls = [Call(vehicle, px4_types.srv.VehicleCommand.Request()) for _ in range(2)]
    assert link.called.wait(WAIT)
    link.disconnect(remote, "gone")
    for call in calls:
        assert isinstance(call.result(), NotConnectedError)


def test_the_queue_of_calls_is_bounded(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    remote = link.connect()
    request = px4_types.srv.VehicleCommand.Request()
    calls = [Call(vehicle, request) for _ in range(WAITING + 5)]
    deadline = time.monotonic() + WAIT
    while sum(call.is_alive() for call in calls) > WAITING + 1 and time.monotonic() < deadline:
        time.sleep(0.001)
    link.disconnect(remote)
    errors = [str(call.result()) for call in calls]
    assert sum("16 calls of '/fmu/vehicle_command' are waiting" in error for error in errors) == 4


def test_a_callback_can_publish_and_cannot_wait(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    errors: list[str] = []

    def callback(_: Any) -> None:
        vehicle.publish(px4_types.OffboardControlMode())
        for wait in (
            lambda: vehicle.call(px4_types.srv.VehicleCommand.Request()),
            vehicle.wait_connected,
            vehicle.wait_disconnected,
            lambda: next(iter(attitude)),
            lambda: attitude.wait_for(bool),
        ):
            try:
                wait()
            except LinkError as error:
                errors.append(str(error))

    attitude = vehicle.subscribe(px4_types.VehicleAttitude)
    vehicle.subscribe(px4_types.VehicleStatus, callback)
    remote = link.connect()
    link.sample(remote, px4_types.VehicleStatus())
    text = "a callback cannot wait for the vehicle, because its thread receives: use another thread"
    assert errors == [text] * 5
    assert link.published[0][1].name == "/fmu/in/offboard_control_mode"


def test_a_call_that_cannot_be_made_names_the_cure(link: FakeLink, vehicle: Vehicle, px4_types: Any) -> None:
    request = px4_types.srv.VehicleCommand.Request()
    with pytest.raises(NotConnectedError, match="no vehicle is connected"):
        vehicle.call(request)
    link.connect(is_open=False)
    with pytest.raises(TopicError, match="has no service 'VehicleCommand': it has no service"):
        vehicle.call(request)
    with pytest.raises(
        TypeError, match=r"expected a request such as srv.VehicleCommand.Request\(...\), got VehicleComm"
    ):
        vehicle.call(px4_types.VehicleCommand())


def test_two_repeaters_that_close_the_vehicle_do_not_wait_for_each_other(link: FakeLink, vehicle: Vehicle) -> None:
    link.connect()
    both = threading.Barrier(2)

    def close() -> None:
        both.wait(WAIT)
        vehicle.close()

    repeaters = [vehicle.every(100, close) for _ in range(2)]
    for repeater in repeaters:
        repeater._thread.join(WAIT)
        assert (repeater.is_running, repeater.error) == (False, None)
