"""Measure how many times faster than real time simulated vehicles fly.

    python benchmarks/simulated.py            half a minute
    python benchmarks/simulated.py --quick    checks in a few seconds that it works
    python benchmarks/simulated.py --write    writes the table to docs/benchmarks.md, too

`alone` is the flight that `msggen sim --log` writes. In `one process`, a program answers the arming checks of its mode
and sends 30 setpoints a second of the vehicle's time, through the agent and without sockets: to each kind of vehicle.
In `sockets`, the vehicle is another process, and the samples are decoded here: the share of those that arrive in a
second of the vehicle's time.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from typing import Any, NamedTuple

from environment import ROOT
from link import Meter
from msggen.link.link import Opened, Remote, Route, Sample
from msggen.link.udp import UdpLink
from msggen.link.xrce.agent import Agent
from msggen.sim import Options, SimulatedVehicle
from msggen.sim.alone import BOOT, LoneFlight
from page import KEPT, kept, machine
from tables import Table

sys.path.insert(0, str(ROOT / "generated"))

SPEEDS = (1, 2, 5, 10, 20)
HEAD = ["simulated", "times real time", "samples, of those at speed 1"]
STEP = 1_000
"""The time in us between two exchanges of datagrams."""
SETPOINT = 33_000
ACTIVATION = 15
COMMANDS = {4: (400, 1.0), ACTIVATION: (100_001, 23.0)}
"""The commands, with their first parameters, by the times in s: arm, select the mode of the program."""
TAKEOFF = {3: (22, math.nan)}
FREE = (math.nan,) * 3


class Trip(NamedTuple):
    """What a program tells a vehicle."""

    commands: Mapping[int, tuple[int, float]]
    kind: int
    """The type of its SetpointConfig."""
    setpoints: Mapping[str, Mapping[str, Any]]
    """The fields of each message, by topics in uORB."""


NORTH = {
    "fixed_wing_lateral_setpoint": {"course": 0.0, "airspeed_direction": math.nan, "lateral_acceleration": math.nan},
    "fixed_wing_longitudinal_setpoint": {
        **dict.fromkeys(("altitude", "equivalent_airspeed", "pitch_direct", "throttle_direct"), math.nan),
        "height_rate": 1.0,
    },
}
LEVEL = {
    "trajectory_setpoint": {
        "position": FREE,
        "velocity": (math.nan, math.nan, 0.0),
        "acceleration": (0.0, 0.0, math.nan),
    }
}
THERE_BY_WINGS = Trip(TAKEOFF | COMMANDS | {ACTIVATION + 1: (3000, 4.0)}, 4, {**LEVEL, **NORTH})
DRIVE = Trip(
    COMMANDS,
    7,
    {
        "rover_position_setpoint": {
            "position_ned": (20.0, 0.0),
            "start_ned": (math.nan, math.nan),
            **dict.fromkeys(("cruising_speed", "arrival_speed", "yaw"), math.nan),
        }
    },
)
TRIPS: Mapping[str, Trip] = {
    "multicopter": Trip(TAKEOFF | COMMANDS, 2, {"goto_setpoint": {"position": (20.0, 0.0, -10.0)}}),
    "plane": Trip(TAKEOFF | COMMANDS, 3, NORTH),
    "vtol": THERE_BY_WINGS,
    "tailsitter": THERE_BY_WINGS,
    "rover": DRIVE,
    "differential": DRIVE,
}
"""By kinds of vehicles."""
ADDRESS = ("127.0.0.1", 40_000)
PAGE = ROOT / "docs" / "benchmarks.md"
HOW = """\
`alone` is a flight without programs, as `msggen sim --log` writes it. `one process` is a program and a vehicle without
sockets: it answers arming checks, and sends 30 setpoints a second of the vehicle's time. A vehicle behind `sockets` is
another process. Processor time counts, except for sockets."""


class Quiet:
    """A log that keeps nothing."""

    def add(self, topic: str, message: Any) -> None:
        """Do nothing."""

    def text(self, time: int, text: str) -> None:
        """Do nothing."""


def alone(seconds: float, vehicle: str = "multicopter") -> float:
    """Return how many times faster than real time a vehicle flies by itself."""
    flight = LoneFlight(importlib.import_module("px4_types"), Options(vehicle=vehicle), 0)
    start = time.process_time()
    flight.run(Quiet(), BOOT + round(seconds * 1e6))
    return (flight.time - BOOT) / 1e6 / (time.process_time() - start)


class Program:
    """Registers a mode, arms, takes off and sends setpoints, as messages."""

    def __init__(self, agent: Agent, trip: Trip) -> None:
        self._trip = trip
        self.types = importlib.import_module("px4_types")
        self._agent = agent
        self._decode: dict[str, Callable[[bytes], Any]] = {}
        self._ids: dict[str, int] = {}
        self._setpoint_time = self._step = 0
        self._by_name = {each.ros_name: each for each in self.types.topics.ENDPOINTS}
        self.north = self.height = 0.0
        """Where the vehicle is, in m."""

    def send(self, topic: str, message: Any) -> None:
        """Publish a message on a topic of uORB."""
        self._agent.publish(1, self._ids[topic], message.encode())

    def take(self, event: object) -> None:
        """Take an event of the agent. All samples are decoded."""
        if isinstance(event, Opened):
            endpoint = self._by_name.get(event.route.name)
            if endpoint is not None and isinstance(event.route, Route):
                self._ids[endpoint.uorb_topic] = event.route.object_id
                self._decode[event.route.name] = endpoint.message.decode
        elif isinstance(event, Sample):
            message = self._decode[event.route.name](event.payload)
            if type(message) is self.types.ArmingCheckRequest:
                reply = self.types.ArmingCheckReply(request_id=message.request_id, can_arm_and_run=True)
                self.send("arming_check_reply", reply)
            elif type(message) is self.types.VehicleLocalPosition:
                self.north, self.height = message.x, -message.z

    def act(self, now: int) -> None:
        """Do what is due at a time in us."""
        if now >= (self._step + 1) * 1_000_000:
            self._step += 1
            if self._step == 1:
                self._register()
            elif self._step in self._trip.commands:
                self._command(*self._trip.commands[self._step])
            if self._step == ACTIVATION:
                config = self.types.SetpointConfig(type=self._trip.kind, source_id=23, should_apply=True)
                self.send("setpoint_config", config)
        if now >= self._setpoint_time + SETPOINT and self._step >= ACTIVATION:
            self._setpoint_time = now
            for topic, fields in self._trip.setpoints.items():
                self.send(topic, self.types.topics.UORB[topic].message(**fields))

    def _register(self) -> None:
        name = b"Benchmark".ljust(25, b"\0")
        wanted = {"register_arming_check": True, "register_mode": True}
        message = self.types.RegisterExtComponentRequest(request_id=1, name=name, **wanted)
        self.send("register_ext_component_request", message)

    def _command(self, number: int, value: float) -> None:
        rest = {f"param{place}": math.nan for place in range(2, 8)}
        self.send("vehicle_command", self.types.VehicleCommand(command=number, param1=value, target_system=1, **rest))


def one_process(seconds: float, kind: str = "multicopter") -> tuple[float, float, float]:
    """Return how many times faster than real time a vehicle and a program fly, and how far north and high in m."""
    options = Options(vehicle=kind, sync="off")
    vehicle, agent = SimulatedVehicle(importlib.import_module("px4_types"), options), Agent(0.0)
    program = Program(agent, TRIPS[kind])
    start, due = time.process_time(), 0
    for now in range(0, round(seconds * 1e6), STEP):
        if due <= now:
            vehicle.advance(now) if vehicle.next_time <= now else None
            for data, connection in vehicle.take_outgoing():
                agent.receive(data, (ADDRESS[0], ADDRESS[1] + connection), now * 1000)
            due = vehicle.next_time
        if not now % 100_000:
            agent.tick(now / 1e6)
        for event in agent.take_events():
            program.take(event)
        if vehicle.is_connected:
            program.act(now)
        for data, _ in agent.take_outgoing():
            vehicle.receive(data, now)
            due = now  # it may have answered
    return seconds / (time.process_time() - start), program.north, program.height


class Receiver(Meter):
    """A listener that decodes samples and counts them."""

    def __init__(self) -> None:
        super().__init__(100)
        self.count = 0
        self.times: tuple[int, ...] = ()
        """The times of the first and the last sample, each in us of the vehicle's clock and in ns of this one's."""

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:  # noqa: ARG002
        """Decode a sample."""
        now = self.decode[route.ros_type](payload).timestamp, time
        self.times = (*(self.times[:2] or now), *now)
        self.count += 1

    def rates(self) -> tuple[float, float]:
        """Return the speed, and the samples in a second of the vehicle's time."""
        first, started, last, ended = self.times
        return (last - first) * 1e3 / (ended - started), self.count / (last - first) * 1e6


def sockets(speed: float, seconds: float) -> tuple[float, float]:
    """Return the speed of a vehicle behind a socket, and the samples in a second of its time."""
    receiver = Receiver()
    link = UdpLink(port=0)
    link.start(receiver)
    try:
        words = ["sim", f"udp://127.0.0.1:{link.port}", "--types", str(ROOT / "generated" / "px4_types"), "-q"]
        times = ["--speed", str(speed), "--sync", "off", "--for", str(seconds * speed)]
        subprocess.run([sys.executable, "-m", "msggen", *words, *times], check=True, cwd=ROOT)
    finally:
        link.close()
    return receiver.rates()


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description="Measure how much faster than real time simulated vehicles fly.")
    parser.add_argument("--quick", action="store_true", help="little, to see that it works")
    parser.add_argument("--write", action="store_true", help="write the table to docs/benchmarks.md")
    options = parser.parse_args()
    seconds, load = 5.0 if options.quick else 60.0, os.getloadavg()[0]
    rows = [[f"{kind} alone", f"{alone(seconds, kind):.0f}", ""] for kind in TRIPS]
    one_process(16.0)  # imports the messages
    for kind in TRIPS:
        ratio, north, height = one_process(seconds, kind)
        rows.append([f"{kind} in one process, {north:.0f} m north, {height:.0f} m high", f"{ratio:.0f}", ""])
    base = 0.0
    for speed in SPEEDS:
        reached, rate = sockets(speed, seconds / 20)
        base = base or rate
        rows.append([f"sockets, --speed {speed}", f"{reached:.1f}", f"{rate / base:.0%}"])
    table = Table("simulated vehicles", HEAD, rows)
    table.print()
    if options.write:
        write(table, f"Last run: {datetime.now(timezone.utc).date()}, on {machine()}, at a load of {load:.0f}.")


def write(table: Table, when: str) -> None:
    """Write a table to the page of benchmarks, as its last section."""
    text = PAGE.read_text(encoding="utf-8")
    parts = (f"## {KEPT}", "```console\n$ python benchmarks/simulated.py --write\n```", when, HOW, table.markdown())
    PAGE.write_text(f"{text.removesuffix(kept(text))}\n{(chr(10) * 2).join(parts)}\n", encoding="utf-8")


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main()
