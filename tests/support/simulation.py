"""Simulated vehicles and agents on a virtual clock, without sockets."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType
from typing import Any

from msggen.sim import Options, SimulatedVehicle
from support.xrce_agent import SmallAgent

SECOND = 1_000_000
NAN = math.nan
FREE = (NAN, NAN, NAN)
SHORT = Options(sync="short")


def topics_of(package: ModuleType) -> Any:
    """Return the tables of a generated package."""
    return importlib.import_module(f"{package.__name__}.topics")


class Bench:
    """A simulated vehicle and a small agent."""

    def __init__(self, package: ModuleType, options: Options = SHORT) -> None:
        self.package = package
        self.topics = topics_of(package)
        self.vehicle = SimulatedVehicle(package, options)
        self.answers: list[bytes] = []
        self.agent = SmallAgent(self.answers.append)
        self.now = 0
        self.sent: list[tuple[int, bytes, int]] = []
        """All datagrams of the vehicle, with their times and connections."""

    def run(self, seconds: float, each: Callable[[], None] = lambda: None) -> None:
        """Let time pass. `each` is called after every step, of up to 100 ms."""
        end = self.now + round(seconds * SECOND)
        while self.now < end:
            self.vehicle.advance(self.now)
            self._exchange()
            each()
            next_time = min(end, self.now // 100_000 * 100_000 + 100_000, self.vehicle.next_time)
            self.now = max(next_time, self.now + 1)
            if not self.now % 200_000:
                self.agent.tick()
                self._exchange()

    def _exchange(self) -> None:
        """Carry datagrams both ways until there are none."""
        while True:
            datagrams = self.vehicle.take_outgoing()
            for data, connection in datagrams:
                self.sent.append((self.now, data, connection))
                self.agent.receive(data, self.now)
            answers = self.answers[:]
            self.answers.clear()
            for answer in answers:
                self.vehicle.receive(answer, self.now)
            if not datagrams and not answers:
                return

    # What a program does

    def publish(self, message: Any, topic: str = "") -> None:
        """Publish to the topic of a message, or to a uORB topic."""
        name = next(
            each.ros_name
            for each in self.topics.in_
            if each.message_name == type(message).__name__ and topic in ("", each.uorb_topic)
        )
        self.agent.publish(self.name(name), message.encode())
        self._exchange()

    def name(self, ros_name: str) -> str:
        """Return the name of a topic of this vehicle in DDS."""
        namespace = self.vehicle.options.namespace
        return f"rt/{namespace}{ros_name}" if namespace else f"rt{ros_name}"

    def command(
        self,
        number: int,
        *parameters: float,
        target_system: int = 1,
        topic: str = "vehicle_command",
        source_component: int = 0,
    ) -> int:
        """Send a command and return the result that the vehicle acknowledges, -1 for none."""
        values = {f"param{index + 1}": value for index, value in enumerate(parameters)}
        seen = len(self.agent.samples)
        message = self.package.VehicleCommand(
            command=number,
            target_system=target_system,
            source_system=1,
            source_component=source_component,
            **values,
        )
        self.publish(message, topic)
        found = [ack.result for ack in self.messages("vehicle_command_ack", seen) if ack.command == number]
        return found[-1] if found else -1

    def offboard(self, **setpoint: Any) -> None:
        """Publish a heartbeat and a setpoint."""
        controls = {name: name in setpoint for name in ("position", "velocity", "acceleration")}
        self.publish(self.package.OffboardControlMode(**controls))
        free = {"position": FREE, "velocity": FREE, "acceleration": FREE, "yaw": NAN, "yawspeed": NAN}
        self.publish(self.package.TrajectorySetpoint(**{**free, **setpoint}))

    def messages(self, topic: str, start: int = 0) -> Iterator[Any]:
        """Yield the messages that the vehicle has published on a uORB topic."""
        endpoint = next((each for each in self.topics.out if each.uorb_topic == topic), None)
        if endpoint:
            name = self.name(endpoint.ros_name)
            for found, sample in self.agent.samples[start:]:
                if found == name:
                    yield endpoint.message.decode(sample)

    def last(self, topic: str) -> Any:
        """Return the newest message of a topic."""
        endpoint = next(each for each in self.topics.out if each.uorb_topic == topic)
        name = self.name(endpoint.ros_name)
        return next(endpoint.message.decode(sample) for found, sample in reversed(self.agent.samples) if found == name)


def fly(bench: Bench, seconds: float, setpoint: Mapping[str, Any], hz: float = 10.0) -> None:
    """Publish a setpoint at a rate for some time."""
    for _ in range(round(seconds * hz)):
        bench.offboard(**setpoint)
        bench.run(1 / hz)
