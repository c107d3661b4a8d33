"""A program of a flight mode at the level of messages, for a simulated vehicle on a virtual clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from support.simulation import SECOND, Bench

_NAME = 25
_GOTO = 33_000
"""The time in us between two setpoints."""
_CONTROLS = ("allocation", "rates", "attitude", "altitude", "climb_rate", "velocity", "position")


class Program:
    """A mode, with an executor if it is wanted. `run` lets time pass in which it answers arming checks."""

    def __init__(self, bench: Bench, name: str, *, with_executor: bool = False) -> None:
        self.bench, self.types = bench, bench.package
        self.name = name
        self.with_executor = with_executor
        self.answers = True
        """Whether the program answers arming checks."""
        self.check = self.mode = self.executor = -1
        self._seen = 0
        self._goto_time = 0

    # Registration

    def ask_to_register(self, **values: Any) -> None:
        """Send the request."""
        asked = {
            "request_id": hash(self.name) & 0xFFFF,
            "name": self.name.encode().ljust(_NAME, b"\0"),
            "px4_ros2_api_version": 1,
            "register_arming_check": True,
            "register_mode": True,
            "register_mode_executor": self.with_executor,
        }
        self.bench.publish(self.types.RegisterExtComponentRequest(**{**asked, **values}))

    def register(self, **values: Any) -> Any:
        """Register, and return the reply."""
        self.ask_to_register(**values)
        self.bench.run(0.05)
        reply = self.bench.last("register_ext_component_reply")
        assert reply.request_id == hash(self.name) & 0xFFFF
        self.check, self.mode, self.executor = reply.arming_check_id, reply.mode_id, reply.mode_executor_id
        return reply

    def unregister(self) -> None:
        """Unregister all."""
        message = self.types.UnregisterExtComponent(
            name=self.name.encode().ljust(_NAME, b"\0"),
            arming_check_id=self.check,
            mode_id=self.mode,
            mode_executor_id=self.executor,
        )
        self.bench.publish(message)

    def configure(self) -> None:
        """Tell what the setpoints control."""
        if hasattr(self.types, "SetpointConfig"):
            kind = self.types.SetpointConfig.TYPE_MULTICOPTER_GOTO
            self.bench.publish(self.types.SetpointConfig(type=kind, source_id=self.mode, should_apply=True))
        else:
            flags = {f"flag_control_{name}_enabled": True for name in _CONTROLS}
            self.bench.publish(self.types.VehicleControlMode(source_id=self.mode, **flags), "config_control_setpoints")
        self.run(0.05)

    # Time

    def run(self, seconds: float, goto: tuple[float, float, float] | None = None) -> None:
        """Let time pass."""

        def each() -> None:
            self.answer()
            if goto is not None and self.bench.now >= self._goto_time + _GOTO:
                self._goto_time = self.bench.now
                self.bench.publish(self.types.GotoSetpoint(position=goto))

        self.bench.run(seconds, each)

    def run_until(self, is_done: Callable[[], bool], seconds: float, **options: Any) -> None:
        """Let time pass until something is done. Fails if it is not in time."""
        end = self.bench.now + round(seconds * SECOND)
        while not is_done():
            assert self.bench.now < end
            self.run(0.1, **options)

    def answer(self) -> None:
        """Answer the requests to arming checks that are new."""
        seen = len(self.bench.agent.samples)
        start, self._seen = (self._seen if self._seen <= seen else 0), seen  # a new session begins with none
        if not self.answers or self.check < 0:
            return
        for request in [*self.bench.messages("arming_check_request", start)]:
            reply = self.types.ArmingCheckReply(
                request_id=request.request_id, registration_id=self.check, can_arm_and_run=True
            )
            self.bench.publish(reply)

    # Commands

    def command(self, number: int, *parameters: float) -> int:
        """Send a command as a user does, and return its result."""
        return self.bench.command(number, *parameters)

    def as_executor(self, number: int, *parameters: float) -> int:
        """Send a command as the executor, and return its result."""
        return self.bench.command(
            number, *parameters, topic="vehicle_command_mode_executor", source_component=1000 + self.executor
        )

    # What the vehicle tells

    @property
    def status(self) -> Any:
        """The last VehicleStatus."""
        return self.bench.last("vehicle_status")

    @property
    def completed(self) -> list[int]:
        """The modes whose end was told."""
        return [message.nav_state for message in self.bench.messages("mode_completed")]

    def distance(self, place: tuple[float, float, float]) -> float:
        """Return the distance of the vehicle to a place in m."""
        return math.dist(self.bench.vehicle.world.flight.position, place)


class Programs(list[Program]):
    """Several programs of one vehicle."""

    def answer(self) -> None:
        """Let each answer the requests to arming checks."""
        for program in self:
            program.answer()
