"""Tests of the service of a vehicle in ROS, with stand-ins for rclpy: each call is answered, and none is late."""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from msggen.link.link import LinkError
from msggen.live import Vehicle
from msggen.ros import service as module
from msggen.ros.plan import ServiceRow
from msggen.ros.service import Server
from msggen.vehicle.refusals import Refusals
from support.fake_link import SERVICE, FakeLink

NAME = "/uav_1/fmu/vehicle_command"


class FakeService:
    """A service of rclpy, whose requests are messages of the package."""

    def __init__(self) -> None:
        self.requests: queue.SimpleQueue[tuple[Any, Any]] = queue.SimpleQueue()
        self.answers: queue.SimpleQueue[tuple[Any, Any]] = queue.SimpleQueue()
        self.errors: list[Exception] = []
        """What the next answers raise."""

    @property
    def handle(self) -> FakeService:
        return self

    def __enter__(self) -> None:
        """Return nothing, as rclpy."""

    def __exit__(self, *_: object) -> None:
        """Do nothing."""

    def service_take_request(self, _: Any) -> tuple[Any, Any]:
        try:
            return self.requests.get_nowait()
        except queue.Empty:
            return None, None

    def send_response(self, response: Any, header: Any) -> None:
        if self.errors:
            raise self.errors.pop()
        self.answers.put((response, header))

    def ask(self, request: Any, waited: float = 0.0) -> Any:
        """Queue a request that was sent some s ago, and return its header."""
        header = SimpleNamespace(source_timestamp=time.time_ns() - round(waited * 1e9))
        self.requests.put((request, header))
        return header


class Bench:
    """A vehicle on a link without sockets, and a server of its service."""

    def __init__(self, package: Any, vehicle: Any, link: FakeLink, remote: Any) -> None:
        self.package, self.vehicle, self.link, self.remote = package, vehicle, link, remote
        self.service = FakeService()
        self.refusals = Refusals()
        self.group: Any = None
        self.warned: list[str] = []
        self.destroyed: list[Any] = []
        self.row = ServiceRow(
            SERVICE._replace(name=NAME),
            SimpleNamespace(Request=None, Response=package.srv.VehicleCommand.Response),
            package.srv.VehicleCommand.Request,
            package.srv.VehicleCommand.Response,
        )

    def create_service(self, _: Any, name: str, _callback: Any, qos_profile: Any, callback_group: Any) -> FakeService:
        assert name == NAME
        assert (qos_profile.reliability.name, qos_profile.depth) == ("RELIABLE", module.WAITING)
        self.group = callback_group
        return self.service

    def destroy_service(self, made: Any) -> None:
        self.destroyed.append(made)

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warned.append)

    def request(self, command: int) -> Any:
        return self.package.srv.VehicleCommand.Request(request=self.package.VehicleCommand(command=command))

    def called(self) -> tuple[int, int]:
        """Wait for a request on the link, and return its number and its command."""
        assert self.link.called.wait(10)
        self.link.called.clear()
        _, _, number, payload = self.link.calls[-1]
        return number, self.package.srv.VehicleCommand.Request.decode(payload).request.command

    def reply(self, number: int, **values: Any) -> None:
        """Let the vehicle reply."""
        reply = self.package.VehicleCommandAck(**values)
        payload = self.package.srv.VehicleCommand.Response(reply=reply).encode()
        self.link.user().replied(self.remote, SERVICE, number, payload)

    def answer(self) -> tuple[Any, Any]:
        """Return the next answer in ROS, and its header."""
        response, header = self.service.answers.get(timeout=10)
        return response.reply, header


@pytest.fixture(autouse=True)
def rclpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for the modules of rclpy. Messages of ROS are those of the package."""
    modules: dict[str, Any] = {
        "rclpy": {},
        "rclpy.callback_groups": {"CallbackGroup": object},
        "rclpy.serialization": {
            "serialize_message": lambda message: message.encode(),
            "deserialize_message": lambda data, cls: cls.decode(data),
        },
        "rclpy.qos": {
            "QoSProfile": SimpleNamespace,
            "DurabilityPolicy": Enum("DurabilityPolicy", "TRANSIENT_LOCAL VOLATILE"),
            "HistoryPolicy": Enum("HistoryPolicy", "KEEP_LAST KEEP_ALL"),
            "ReliabilityPolicy": Enum("ReliabilityPolicy", "RELIABLE BEST_EFFORT"),
        },
    }
    for name, values in modules.items():
        made = ModuleType(name)
        vars(made).update(values)
        monkeypatch.setitem(sys.modules, name, made)


@pytest.fixture
def bench(px4_types: Any) -> Iterator[Bench]:
    link = FakeLink(px4_types)
    with Vehicle(link, px4_types) as vehicle:
        remote = link.connect(namespace="uav_1")
        yield Bench(px4_types, vehicle, link, remote)


@contextmanager
def served(bench: Bench) -> Iterator[Server]:
    """Serve the service for the time of the block."""
    server = Server(bench, bench.vehicle, bench.row, bench.refusals)
    try:
        yield server
    finally:
        server.close()


def test_a_call_gets_the_answer_of_the_vehicle(bench: Bench) -> None:
    with served(bench) as server:
        header = bench.service.ask(bench.request(400))
        number, command = bench.called()
        assert command == 400
        bench.reply(number, command=400, result=2, timestamp=7)
        reply, answered = bench.answer()
        assert answered is header
        assert (reply.command, reply.result, reply.timestamp) == (400, 2, 7)
        assert server.answered == {NAME: 1}
    assert bench.destroyed == [bench.service]
    assert not bench.refusals.counts


def test_no_executor_takes_the_calls(bench: Bench) -> None:
    """A thread of its own waits for the vehicle: samples go on."""
    with served(bench):
        assert not bench.group.can_execute(None)
        assert not bench.group.beginning_execution(None)
        bench.service.ask(bench.request(400))
        bench.called()  # in the other thread, which waits for the reply from now on
        bench.vehicle.publish(bench.package.TrajectorySetpoint())
        bench.link.sample(bench.remote, bench.package.VehicleStatus(timestamp=5))
        assert bench.service.answers.empty()


def test_calls_wait_for_each_other(bench: Bench) -> None:
    with served(bench):
        headers = [bench.service.ask(bench.request(command)) for command in (1, 2, 3)]
        for command, header in zip((1, 2, 3), headers, strict=True):
            number, found = bench.called()
            assert found == command
            assert len(bench.link.calls) == command, "one is on the wire at a time"
            bench.reply(number, command=command)
            assert bench.answer()[1] is header


def test_a_vehicle_that_does_not_answer(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WAIT_S", 0.1)
    with served(bench) as server:
        bench.service.ask(bench.request(400))
        reply, _ = bench.answer()
        assert (reply.command, reply.result, reply.timestamp) == (400, 4, 0)
        assert not server.answered
    assert bench.refusals.counts == {NAME: 1}
    assert "no reply within " in bench.refusals.reasons[NAME]
    assert bench.warned[0].startswith(f"{NAME}: ")


@pytest.mark.parametrize("waited", [5.0, 5.1, 3600.0])
def test_a_call_that_nobody_waits_for_is_not_sent(bench: Bench, waited: float) -> None:
    with served(bench):
        bench.service.ask(bench.request(400), waited)
        reply, _ = bench.answer()
        assert (reply.command, reply.result) == (400, 1)
        assert not bench.link.calls
        bench.service.ask(bench.request(401))
        number, command = bench.called()
        bench.reply(number, command=401)
        assert (command, bench.answer()[0].result) == (401, 0)
    assert "waited for more than 5 s" in bench.refusals.reasons[NAME]


def test_what_a_call_has_waited_counts(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []

    def call(_: Any, timeout: float) -> Any:
        waits.append(timeout)
        return bench.row.response()

    monkeypatch.setattr(bench.vehicle, "call", call)
    with served(bench):
        bench.service.ask(bench.request(400), waited=3.0)
        bench.service.ask(bench.request(400), waited=-50.0)  # 40 s old, if the clock of the caller is 90 s ahead
        bench.service.requests.put((bench.request(400), SimpleNamespace(source_timestamp=0)))
        results = [bench.answer()[0].result for _ in range(3)]
    assert results == [0, 1, 0]
    assert "s ahead of this one" in bench.refusals.reasons[NAME]
    assert waits[0] <= 2.0
    assert waits[1:] == [5.0]


def test_a_vehicle_that_goes_and_one_that_takes_nothing(bench: Bench) -> None:
    with served(bench):
        bench.service.ask(bench.request(1))
        bench.called()
        bench.link.disconnect(bench.remote)
        assert bench.answer()[0].result == 4, "it may have acted"
        bench.service.ask(bench.request(2))
        assert bench.answer()[0].result == 1
        bench.remote = bench.link.connect(namespace="uav_1")
        bench.link.refusal = LinkError("the client has no room")
        bench.service.ask(bench.request(3))
        assert bench.answer()[0].result == 4
        bench.link.refusal = None
        bench.service.ask(bench.request(4))
        number, _ = bench.called()
        bench.reply(number, command=4)
        assert bench.answer()[0].result == 0
    assert len(bench.link.calls) == 2
    assert len(bench.warned) == 3


def test_a_caller_that_is_gone_ends_no_service(bench: Bench) -> None:
    bench.service.errors.append(RuntimeError("rcl_send_response failed"))  # as RCLError of rclpy
    with served(bench):
        for command in (1, 2):
            bench.service.ask(bench.request(command))
            number, _ = bench.called()
            bench.reply(number, command=command)
        assert bench.answer()[0].command == 2
    assert bench.refusals.reasons == {NAME: "rcl_send_response failed"}


def test_a_call_during_the_end_gets_no_answer(bench: Bench) -> None:
    with served(bench):
        bench.service.ask(bench.request(1))
        bench.called()
    bench.link.disconnect(bench.remote)
    for thread in threading.enumerate():
        if thread.name == f"relay {NAME}":
            thread.join(10)
            assert not thread.is_alive()
    assert bench.service.answers.empty()
    assert not bench.warned
