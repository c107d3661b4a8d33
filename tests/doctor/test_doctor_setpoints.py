"""Tests of what the doctor finds in the other direction: programs that misbehave, and vehicles that do not follow.

The vehicles of a test share a port, each in a namespace of its own and with a program of its own.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, TypeAlias

import pytest

from msggen.cli import main
from msggen.doctor.decoding import decoded
from msggen.doctor.examples import STEERED
from msggen.doctor.expected import Expected, expected_of
from msggen.doctor.observation import Observation, SampleSeen
from msggen.doctor.watching import Plan, observe
from msggen.link.address import parse_address
from msggen.live import Vehicle
from msggen.sim import Misbehaviour, Options, Simulator
from msggen.vehicle.owned.places import CAN_SHARE
from support.dds_vehicle import domains
from support.dds_vehicle import vehicle as dds_vehicle
from support.examples import by_day
from support.faults import rules_of
from support.findings import ids, judged, texts
from support.link_records import nothing_is_left
from support.ports import free_port
from support.repository import ROOT
from support.served import owned

shared = pytest.mark.skipif(not CAN_SHARE, reason="links are not shared on Windows")
PACKAGE = str(ROOT / "generated" / "px4_types")
CALM = Options(sync="short", rate=5.0)
NAN = (math.nan, math.nan, math.nan)
HEIGHT = (0.0, 0.0, -3.0)
SECONDS = 2.8
OFFBOARD = 14
DOMAINS = domains(107)
Program: TypeAlias = Callable[[Vehicle, Any], object]
"""What a program does with its vehicle."""


@pytest.fixture
def url(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.delenv("MSGGEN_DIRECT")
    monkeypatch.setattr("msggen.doctor.watching._SETTLED_S", 0.1)
    with nothing_is_left():
        yield f"udp://127.0.0.1:{free_port()}"


@pytest.fixture(scope="module")
def expected(px4_types: Any) -> Expected:
    found = expected_of(px4_types, "px4_types", is_given=True)
    return found._replace(topics=tuple(topic._replace(interval=0.2) for topic in found.topics))


def position(package: Any, **values: Any) -> Any:
    """Return a setpoint for a position."""
    return package.TrajectorySetpoint(**{"position": HEIGHT, "velocity": NAN, "acceleration": NAN, **values})


def send(vehicle: Vehicle, *messages: Any, rate: float = 20.0) -> None:
    """Publish messages again and again, until the vehicle is closed."""
    for message in messages:
        vehicle.every(rate, message)


def cut(package: Any) -> Any:
    """Return a setpoint without its last field, as a program with another definition writes it."""

    class Cut(package.TrajectorySetpoint):  # type: ignore[misc] # the package is an argument
        def encode(self) -> bytes:
            data: bytes = super().encode()
            return data[:-4]

    return Cut(position=HEIGHT, velocity=NAN, acceleration=NAN)


def command(vehicle: Vehicle, package: Any, number: int, *parameters: float) -> int:
    """Send a command, and return its result."""
    values = {f"param{index}": value for index, value in enumerate(parameters, 1)}
    request = package.VehicleCommand(command=number, target_system=0, **values)
    return int(vehicle.call(package.srv.VehicleCommand.Request(request=request), timeout=5).reply.result)


def arm(vehicle: Vehicle, package: Any) -> int:
    return command(vehicle, package, 400, 1)


def offboard(vehicle: Vehicle, package: Any) -> int:
    return command(vehicle, package, 176, 1, 6)


def begin(vehicle: Vehicle, package: Any, *messages: Any) -> None:
    """Publish, by default a position, until the vehicle can be armed in Offboard mode."""
    send(vehicle, *(messages or (package.OffboardControlMode(position=True), position(package))))
    select(vehicle, package)


def select(vehicle: Vehicle, package: Any) -> None:
    """Select Offboard mode, and wait until the vehicle can be armed."""
    assert offboard(vehicle, package) == 0
    ready = vehicle.subscribe(package.VehicleStatus)
    ready.wait_for(lambda each: each.nav_state == OFFBOARD and each.pre_flight_checks_pass, timeout=10)


def paused(package: Any) -> Callable[[], Any]:
    """Return a function that returns a message, or None for 1.15 s in every 1.4 s.

    So each SECONDS have a whole pause.
    """
    start = time.monotonic()

    def message() -> Any:
        is_paused = (time.monotonic() - start) % 1.4 > 0.25
        return None if is_paused else package.OffboardControlMode(position=True)

    return message


def flying(vehicle: Vehicle, package: Any) -> None:
    """Fly, and stop to publish in the air."""
    with vehicle.every(20, package.OffboardControlMode(position=True)), vehicle.every(20, position(package)):
        select(vehicle, package)
        arm(vehicle, package)
        place = vehicle.subscribe(package.VehicleLocalPosition)
        place.wait_for(lambda each: each.z < -2.5, timeout=20)
    vehicle.subscribe(package.VehicleStatus).wait_for(lambda each: each.failsafe, timeout=10)


def rare(vehicle: Vehicle, package: Any) -> None:
    send(vehicle, package.OffboardControlMode(position=True), rate=1.0)
    send(vehicle, position(package))


def healthy(vehicle: Vehicle, package: Any) -> None:
    begin(vehicle, package)
    arm(vehicle, package)


def steer(vehicle: Vehicle, package: Any) -> None:
    send(vehicle, package.OffboardControlMode(position=True), position(package))


def no_position(vehicle: Vehicle, package: Any) -> None:
    steer(vehicle, package)
    time.sleep(0.5)
    arm(vehicle, package)


def refused_mode(vehicle: Vehicle, package: Any) -> None:
    send(vehicle, position(package))
    arm(vehicle, package)  # a vehicle on the ground accepts every mode until it is armed
    offboard(vehicle, package)


def other_mode(vehicle: Vehicle, package: Any) -> None:
    steer(vehicle, package)
    arm(vehicle, package)


GROUND: dict[str, Program] = {
    "no mode": lambda vehicle, types: send(vehicle, position(types)),
    "rare": rare,
    "gap": lambda vehicle, types: send(vehicle, paused(types), position(types)),
    "unselected": lambda vehicle, types: send(
        vehicle,
        types.OffboardControlMode(position=True),
        types.VehicleAttitudeSetpoint(q_d=(1.0, 0.0, 0.0, 0.0), thrust_body=(0.0, 0.0, -0.5)),
    ),
    "nothing selected": lambda vehicle, types: send(vehicle, types.OffboardControlMode(), position(types)),
    "nan": lambda vehicle, types: send(
        vehicle, types.OffboardControlMode(position=True), position(types, position=NAN)
    ),
}
MORE: dict[str, Program] = {
    "no attitude": lambda vehicle, types: send(
        vehicle, types.OffboardControlMode(attitude=True), types.VehicleAttitudeSetpoint(thrust_body=(0.0, 0.0, -0.5))
    ),
    "upward": lambda vehicle, types: send(
        vehicle, types.OffboardControlMode(position=True), position(types, position=(0.0, 0.0, 5.0))
    ),
    "thrust": lambda vehicle, types: send(
        vehicle,
        types.OffboardControlMode(attitude=True),
        types.VehicleAttitudeSetpoint(q_d=(1.0, 0.0, 0.0, 0.0), thrust_body=(0.0, 0.0, 0.7)),
    ),
    "old": lambda vehicle, types: send(
        vehicle, types.OffboardControlMode(position=True), position(types, timestamp=12_000_000)
    ),
    "cut": lambda vehicle, types: send(
        vehicle, types.OffboardControlMode(position=True), cut(types)
    ),
    "other system": lambda vehicle, types: send(
        vehicle,
        types.OffboardControlMode(position=True),
        position(types),
        types.VehicleCommand(command=400, param1=1.0, target_system=3, target_component=1),
    ),
}  # fmt: skip
STATE: dict[str, Program] = {
    "healthy": healthy,
    "no position": no_position,
    "checks": lambda vehicle, types: send(vehicle, types.OffboardControlMode(position=True), position(types)),
    "disarmed": begin,
    "refused mode": refused_mode,
    "other mode": other_mode,
    "failsafe": flying,
}  # fmt: skip


def camera(
    vehicle: Vehicle,
    package: Any,
    *,
    late: float = 0.05,
    rate: float = 20.0,
    topic: str = "/fmu/in/vehicle_visual_odometry",
    **values: Any,
) -> None:
    """Send where a camera sees the vehicle."""
    place = {"position": (0.0, 0.0, 0.0), "pose_frame": 1, "velocity": NAN, "q": (math.nan,) * 4, **values}

    def message() -> Any:
        return package.VehicleOdometry(timestamp_sample=vehicle.time - round(late * 1e6), **place)

    vehicle.every(rate, message, topic=topic)


CAMERAS: dict[str, Program] = {
    "half a place": lambda vehicle, types: camera(vehicle, types, position=(1.0, 2.0, math.nan)),
    "late camera": lambda vehicle, types: camera(vehicle, types, late=0.5),
    "early camera": lambda vehicle, types: camera(vehicle, types, late=-3.0),
    "slow camera": lambda vehicle, types: camera(vehicle, types, rate=3.0),
    "unfused camera": camera,
    "motion capture": lambda vehicle, types: camera(vehicle, types, topic="/fmu/in/vehicle_mocap_odometry"),
    "healthy": camera,
}
UNPLACED = {"no position", "checks"}


def looked_at(url: str, package: Any, seconds: float = SECONDS) -> Observation:
    """Return what the doctor sees, decoded."""
    return decoded(observe(parse_address(url), Plan(seconds, 20.0)), lambda _: [package])


@contextmanager
def programs(url: str, package: Any, rows: dict[str, Program]) -> Iterator[dict[str, int]]:
    """Run vehicles and their programs. Yield the keys of the vehicles by the names of the faults."""
    keys = {name: key for key, name in enumerate(rows, 1)}
    options = [
        CALM._replace(
            key=key,
            namespace=name.replace(" ", "_"),
            misbehaviour=Misbehaviour(no_position=name in UNPLACED),
            parameters={"EKF2_EV_CTRL": 15.0} if name == "healthy" else {},
        )
        for name, key in keys.items()
    ]
    with ExitStack() as stack:
        stack.enter_context(owned(url))
        stack.enter_context(Simulator(package, url, options))
        for name, program in rows.items():
            vehicle = stack.enter_context(Vehicle(url, package, key=keys[name]))
            vehicle.wait_connected(20)
            program(vehicle, package)
        yield keys


def check(seen: Observation, expected: Expected, keys: dict[str, int]) -> dict[str, str]:
    """Check that the findings are those of the table. Return the messages by the names of the faults."""
    reports = {name: judged(seen, expected, key=key) for name, key in keys.items()}
    found = {name: ids(report) for name, report in reports.items()}
    assert found == {name: rules_of(name) if name != "healthy" else [] for name in keys}
    return {name: texts(report) for name, report in reports.items()}


@shared
@by_day("rows", [GROUND, MORE], 2, ids=["ground", "more"])
def test_programs_that_misbehave_are_found(
    url: str, px4_types: Any, expected: Expected, rows: dict[str, Program]
) -> None:
    with programs(url, px4_types, rows) as keys:
        told = check(looked_at(url, px4_types), expected, keys)
    (first, *_), own = told.values(), f"(pid {os.getpid()})"
    assert own in first
    assert all(own in each for each in told.values())
    if rows is MORE:
        own_system = f"this vehicle is system {[*rows].index('other system') + 1} (MAV_SYS_ID)"
        assert f"has command 400 for system 3, and {own_system} and ignores it: set" in told["other system"]
        assert "it has 60 bytes, and TrajectorySetpoint of the vehicle has 64" in told["cut"]
        assert "has z = 5 m, which is below the origin: z points down in PX4 (NED), use -5 for 5 m up" in told["upward"]


@shared
def test_vehicles_that_do_not_follow_are_found(url: str, px4_types: Any, expected: Expected) -> None:
    with programs(url, px4_types, STATE) as keys:
        seen = looked_at(url, px4_types, 1.0)
        told = check(seen, expected, keys)
        report = judged(seen, expected, "trajectory_setpoint", key=keys["healthy"])
    assert "'temporarily rejected'" in told["no position"]
    assert "xy_valid, v_xy_valid of vehicle_local_position are false" in told["checks"]
    assert "its checks fail in mode Hold because of local_position_invalid" in told["checks"]
    assert "is in a failsafe, in mode Return because of offboard_control_signal_lost" in told["failsafe"]
    (answer,) = report.answers
    assert answer.startswith("/healthy/fmu/in/trajectory_setpoint: published by ")
    assert f"(pid {os.getpid()}) at " in answer
    assert answer.endswith("; accepted (TrajectorySetpoint version 0, 64 bytes, the vehicle's definition)")


@shared
def test_measurements_that_are_not_used_are_found(url: str, px4_types: Any, expected: Expected) -> None:
    with programs(url, px4_types, CAMERAS) as keys:
        told = check(looked_at(url, px4_types), expected, keys)
    assert "has `position` = (1, 2, nan), which EKF2 drops: set all three" in told["half a place"]
    assert re.search(r"is 0\.[5-9]\d s old by `timestamp_sample`", told["late camera"])
    assert re.search(r"is (3\.0|2\.\d)\d s in the future", told["early camera"])
    assert re.search(r"comes at (3\.[0-4]|2\.[5-9]) Hz, and EKF2 starts to fuse at 5 Hz", told["slow camera"])
    assert (
        "(cs_ev_pos, cs_ev_hgt of estimator_status_flags are false): the bit 1 of EKF2_EV_CTRL"
        in told["unfused camera"]
    )


@shared
def test_a_refusal_before_the_watch_is_found(url: str, px4_types: Any, expected: Expected) -> None:
    unplaced = CALM._replace(misbehaviour=Misbehaviour(no_position=True))
    with owned(url), Simulator(px4_types, url, [unplaced]):
        with Vehicle(url, px4_types) as program:
            program.wait_connected(20)
            assert arm(program, px4_types) == 1
        time.sleep(1.0)
        seen = looked_at(url, px4_types, 0.5)
    (ack,) = seen.vehicles[-1].kept("vehicle_command_ack")
    assert seen.now - ack.time > seen.seconds * 1e9
    report = judged(seen, expected)
    assert [each for each in ids(report) if each != "RATE_LOW"] == rules_of("refused earlier")  # it is a short watch
    assert "has answered the command to arm with 'temporarily rejected'" in texts(report)


@shared
def test_a_topic_that_nobody_publishes_is_found(url: str, px4_types: Any, expected: Expected) -> None:
    with owned(url), Simulator(px4_types, url, [CALM]):
        with Vehicle(url, px4_types) as program:
            program.wait_connected(20)
            program.publish(position(px4_types))
            time.sleep(0.2)
            with_program = judged(looked_at(url, px4_types, 0.5), expected, "trajectory_setpoint")
        seen = looked_at(url, px4_types, 0.5)
    assert ids(with_program) == rules_of("unpublished")
    assert re.search(rf"the last sample came [\d.]+ s ago from .* \(pid {os.getpid()}\): start", texts(with_program))
    report = judged(seen, expected, "trajectory_setpoint")
    assert ids(report) == rules_of("unpublished")
    assert report.answers == ("/fmu/in/trajectory_setpoint: no program publishes it",)
    assert ids(judged(seen, expected)) == []


def test_a_doctor_that_owns_the_link_does_not_know_programs(px4_types: Any, expected: Expected) -> None:
    url = f"udp://127.0.0.1:{free_port()}"
    with Simulator(px4_types, url, [CALM]):
        seen = decoded(observe(parse_address(url), Plan(0.5, 20.0, is_direct=True)), lambda _: [px4_types])
    report = judged(seen, expected, "trajectory_setpoint")
    assert ids(report) == []
    told = "/fmu/in/trajectory_setpoint: not known who publishes it, because this command owns the link; leave out"
    assert report.answers == (f"{told} --direct",)


@shared
def test_two_programs_that_fight_are_found(url: str, px4_types: Any, expected: Expected) -> None:
    words = ["topic", "pub", "-q", "-r", "20", "--types", PACKAGE, "--link", url, "trajectory_setpoint", "{yaw: 1}"]
    with owned(url), Simulator(px4_types, url, [CALM]), Vehicle(url, px4_types) as program:
        program.wait_connected(20)
        send(program, px4_types.OffboardControlMode(position=True), position(px4_types))
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        with subprocess.Popen([sys.executable, "-m", "msggen", *words], env=environment) as other:
            try:
                end = time.monotonic() + 20
                while len({each.pid for each in program.publishers}) < 2:
                    assert time.monotonic() < end
                    time.sleep(0.05)
                report = judged(looked_at(url, px4_types, 1.0), expected)
            finally:
                other.kill()
    assert ids(report) == rules_of("two")
    assert f"msggen topic pub (pid {other.pid}) at " in texts(report)
    assert f"(pid {os.getpid()}) at " in texts(report)


@shared
def test_the_command_answers_who_publishes(url: str, px4_types: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with owned(url), Simulator(px4_types, url, [Options(sync="short")]), Vehicle(url, px4_types) as program:
        program.wait_connected(20)
        begin(program, px4_types)
        assert arm(program, px4_types) == 0
        words = ["doctor", "--link", url, "--for", "1", "--types", PACKAGE, "trajectory_setpoint"]
        assert main(words) == 0
        answer, summary = capsys.readouterr().out.splitlines()
        assert main([*words, "--json"]) == 0
        (told,) = json.loads(capsys.readouterr().out)["answers"]
    assert answer.startswith("/fmu/in/trajectory_setpoint: published by ")
    assert "; accepted (TrajectorySetpoint version 0, 64 bytes" in answer
    assert summary.startswith("no problem found: ")
    assert told.partition(":")[0] == answer.partition(":")[0]


@contextmanager
def dds_writers(*rows: tuple[str, str, bytes]) -> Iterator[int]:
    """Run a vehicle in Offboard mode behind an agent, and a participant that writes samples. Yield the domain.

    A row is a topic, the message of its type, and what is written to it 20 times a second, if it is not empty.
    """
    with ExitStack() as stack:
        domain, closing = next(DOMAINS), threading.Event()
        status = "vehicle_status,nav_state=14,arming_state=2"
        stack.enter_context(dds_vehicle(domain, "", status, "vehicle_attitude"))
        from msggen.link.cyclone import Participant
        from msggen.link.dds import LOOPBACK

        program = Participant(domain, LOOPBACK)
        stack.callback(program.close)
        writers = [
            (program.writer(f"rt/fmu/in/{topic}", f"px4_msgs::msg::dds_::{message}_", is_reliable=False), payload)
            for topic, message, payload in rows
        ]

        def write() -> None:
            while not closing.wait(0.05):
                for writer, payload in writers:
                    if payload:
                        writer.write(payload)

        thread = threading.Thread(target=write)
        thread.start()
        stack.callback(thread.join)
        stack.callback(closing.set)
        yield domain


def in_domain(domain: int, package: Any) -> Observation:
    """Return what the doctor sees in a DDS domain."""
    return decoded(observe(parse_address(f"dds://{domain}"), Plan(3.0, 20.0)), lambda _: [package])


def test_writers_in_dds_are_judged(px4_types: Any) -> None:
    with dds_writers(
        ("trajectory_setpoint_v7", "TrajectorySetpoint", b""),
        ("offboard_control_mode", "TrajectorySetpoint", b""),
        ("trajectory_setpoint", "TrajectorySetpoint", position(px4_types).encode()),
    ) as domain:
        seen = in_domain(domain, px4_types)
    found = judged(seen, expected_of(px4_types, "px4_types", is_given=False))
    assert ids(found) == rules_of("writers")
    assert "what a writer in DDS sends arrives nowhere: '/fmu/in/trajectory_setpoint_v7' has another" in texts(found)
    wrong = "publishes '/fmu/in/offboard_control_mode' as px4_msgs::msg::dds_::TrajectorySetpoint_, and the vehicle"
    assert wrong in texts(found)
    sent = seen.vehicles[0].inputs["/fmu/in/trajectory_setpoint"]
    assert [(program.pid, program.samples) for program in sent.programs] == [(os.getpid(), sent.samples)]
    assert sent.samples > 10
    assert sent.last[-1].values["position"] == HEIGHT


@pytest.mark.parametrize(
    ("front", "problem"),
    [
        ("00010000", ""),
        ("00010003", ""),
        ("00000000", "its encapsulation is 0x0000, and PX4 reads little-endian CDR, 0x0001"),
        ("00070000", "its encapsulation is 0x0007, and PX4 reads little-endian CDR, 0x0001"),
        ("", "its encapsulation is missing, and PX4 reads little-endian CDR, 0x0001"),
    ],
)
def test_the_encapsulation_is_judged(px4_types: Any, front: str, problem: str) -> None:
    """The agent of msggen does not take others, and cyclonedds converts them, but another agent passes them on."""
    (steered,) = STEERED.seen.vehicles
    name = "/fmu/in/trajectory_setpoint"
    data = front and front + position(px4_types).encode()[4:].hex()
    inputs = {name: steered.inputs[name]._replace(last=(SampleSeen(0, data),))}
    seen = STEERED.seen._replace(vehicles=(steered._replace(inputs=inputs, hashes={}),))
    (sample,) = decoded(seen, lambda _: [px4_types]).vehicles[0].inputs[name].last
    assert sample.problem == problem
    assert bool(sample.values) == (not problem)


def test_samples_are_only_decoded_with_the_definition_of_the_vehicle(px4_types: Any) -> None:
    (steered,) = STEERED.seen.vehicles
    name = "/fmu/in/trajectory_setpoint"
    inputs = {name: steered.inputs[name]._replace(last=(SampleSeen(0, position(px4_types).encode().hex()),))}
    own = px4_types.TrajectorySetpoint.__msg__.message_hash
    found = []
    for told in (own, own ^ 1):
        vehicle = steered._replace(inputs=inputs, hashes={"px4_msgs/msg/TrajectorySetpoint": told})
        seen = decoded(STEERED.seen._replace(vehicles=(vehicle,)), lambda _: [px4_types])
        found.append(seen.vehicles[0].inputs[name].last[0])
    assert [each.problem for each in found] == ["", ""]
    assert [each.values.get("position") for each in found] == [HEIGHT, None]
