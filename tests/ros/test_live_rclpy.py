"""The relay and the examples for ROS 2, run in ROS 2: beside a simulated vehicle, or a participant of cyclonedds.

rclpy comes from the package index. px4_msgs is compiled with the types that the tests use, and no others.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from msggen.base.location import Location
from msggen.generate.cache import package_of
from msggen.sim import Options, Simulator
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources, with_archived
from support.catalogs import import_package
from support.dds_vehicle import domains, vehicle
from support.example_program import EXAMPLES, Program, interrupted
from support.ports import free_port
from support.repository import ROOT
from support.ros import compile_package, compile_px4_msgs, ros_python

DOMAINS = domains(2)
NODE = EXAMPLES / "rclpy_node.py"


class Ros(NamedTuple):
    """ROS 2 with compiled messages."""

    python: Path
    packages: Path
    folder: Path

    def run(self, domain: int, *arguments: str) -> Program:
        """Start a program in a domain."""
        folders = [ROOT, ROOT / "generated", ROOT / "ros2" / "msggen_ros", ROOT / "tests", self.packages]
        variables = {
            "PYTHONPATH": os.pathsep.join(map(str, folders)),
            "LD_LIBRARY_PATH": "",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": str(domain),
            "ROS_LOG_DIR": str(self.folder),
        }
        return Program(*arguments, python=self.python, variables=variables)


@pytest.fixture(scope="module")
def ros(px4_types: Any, tmp_path_factory: pytest.TempPathFactory) -> Ros:
    """ROS 2 with a px4_msgs of v1.18, except for one message of an earlier version."""
    python, folder = ros_python(), tmp_path_factory.mktemp("ros")
    archived = import_package(read_catalog(with_archived(find_sources("v1.18"), Location("archived", 0))), folder)
    compile_px4_msgs(
        python,
        folder,
        px4_types.VehicleStatus,
        px4_types.OffboardControlMode,
        px4_types.TrajectorySetpoint,
        px4_types.VehicleCommand,
        px4_types.VehicleCommandAck,
        archived.AirspeedValidatedV0,
        services={"VehicleCommand": (ROOT / "srv" / "VehicleCommand.srv").read_text(encoding="utf-8")},
    )
    transforms = {"TFMessage": "geometry_msgs/TransformStamped[] transforms\n"}  # tf2_msgs has no wheel
    return Ros(python, compile_package(python, folder, "tf2_msgs", transforms), folder)


def test_the_page_shows_the_example() -> None:
    page = (ROOT / "docs" / "package.md").read_text(encoding="utf-8")
    section = page.split("\n## In a ROS 2 node\n")[1].split("\n## ")[0]
    (code,) = re.findall(r"^```python\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)
    assert code in NODE.read_text(encoding="utf-8")


@pytest.mark.night  # installs ROS 2 in half a minute, and compiles for it
@pytest.mark.tools("g++")
def test_the_node_reads_and_writes_topics(px4_types: Any, ros: Ros) -> None:
    domain = next(DOMAINS)
    with vehicle(domain, "", "vehicle_status,nav_state=14") as px4:
        node = ros.run(domain, NODE.name)
        try:
            node.wait_for("^mode: OFFBOARD$")
            assert px4.stdout is not None
            topic, payload = px4.stdout.readline().split()
            assert topic == px4_types.topics.in_.offboard_control_mode.dds_name
            sent = px4_types.OffboardControlMode(position=True)
            assert px4_types.OffboardControlMode.decode(bytes.fromhex(payload)) == sent
            interrupted(node)
            assert node.printed == "mode: OFFBOARD\n"
        finally:
            node.end()


@pytest.fixture
def programs() -> Iterator[list[Program]]:
    """Programs that are ended with the test."""
    started: list[Program] = []
    yield started
    for program in started:
        program.process.kill()
        program.end()


@pytest.mark.night  # flies, in ROS 2
@pytest.mark.tools("g++")
def test_a_node_flies_through_the_relay(px4_types: Any, ros: Ros, programs: list[Program]) -> None:
    """A vehicle without an agent: its topics, a converted one, standard messages and TF arrive, and a node flies it."""
    package_of("v1.18")  # in the cache: ROS's Python has no jinja2 to build it with
    domain, address = next(DOMAINS), f"udp://127.0.0.1:{free_port()}"
    types = str(ROOT / "generated" / "px4_types")
    options = ["--link", address, "--types", types, "--standard", "--translate"]
    relay = ros.run(domain, "-m", "msggen", "relay", *options)
    programs.append(relay)
    with Simulator(px4_types, address, [Options(sync="short", namespace="uav_1", parts=("airspeed",))]):
        relay.wait_for("4 topics to ROS, 4 from ROS", "airspeed_validated: AirspeedValidated as version 0", "  pose: ")
        parameters = ["--ros-args", "-r", "__ns:=/uav_1", "-p", "height:=2.0", "-p", "hover:=0.1"]
        flight = ros.run(domain, "-m", "msggen_ros.offboard", *parameters)
        reader = ros.run(domain, str(ROOT / "tests" / "support" / "ros_reader.py"))
        programs += [flight, reader]
        reader.wait_for("^all arrived$")
        flight.wait_for("taking off", "landing", "landed")
        flight.process.wait(30)  # it still selects Hold
    seen = dict(line.split(" ", 1) for line in reader.printed.splitlines() if line.startswith("/"))
    own = px4_types.VehicleStatus
    status = "/uav_1/fmu/out/vehicle_status_v4"
    assert seen[f"{status}:hash"] == own.__msg__.type_hash
    assert seen[f"{status}:node"] == "/uav_1/msggen_relay"
    assert seen[f"{status}:qos"] == "BEST_EFFORT TRANSIENT_LOCAL"
    payload = bytes.fromhex(seen[status])
    sample = own.decode(payload).encode()
    assert payload == sample + bytes(-len(sample) % 4), "DDS pads samples to multiples of 4 bytes"
    assert own.decode(payload).timestamp > px4_types.clock.CALENDAR
    assert seen["/uav_1/fmu/out/airspeed_validated"] == "AirspeedValidated"
    assert seen["/uav_1/odom"] == "uav_1/odom uav_1/base_link"
    assert seen["/uav_1/pose"] == "uav_1/map"
    assert seen["/uav_1/imu"] == seen["/uav_1/fix"] == "uav_1/base_link"
    assert seen["/tf"] == "uav_1/odom uav_1/base_link"
    assert seen["/tf_static"] == "uav_1/map uav_1/odom"
    interrupted(relay)
    assert re.search(r"^  /uav_1/fmu/in/trajectory_setpoint +\d", relay.printed, re.MULTILINE)
    assert "not carried" not in relay.printed.rpartition("samples to ROS")[2]


@pytest.mark.night  # in ROS 2
@pytest.mark.tools("g++")
def test_nodes_call_the_services_of_two_vehicles(px4_types: Any, ros: Ros, programs: list[Program]) -> None:
    """Each call gets its own answer of its vehicle: to what it carries out, and to a command that does not exist."""
    domain, address = next(DOMAINS), f"udp://127.0.0.1:{free_port()}"
    names, types = [f"/uav_{key}/fmu/vehicle_command" for key in (1, 2)], str(ROOT / "generated" / "px4_types")
    relay = ros.run(domain, "-m", "msggen", "relay", "vehicle_command", "--link", address, "--types", types)
    programs.append(relay)
    arm, unknown = px4_types.VehicleCommand.VEHICLE_CMD_COMPONENT_ARM_DISARM, 60000
    results = px4_types.VehicleCommandAck.VehicleCmdResult
    with Simulator(px4_types, address, [Options(key=key, sync="short", namespace=f"uav_{key}") for key in (1, 2)]):
        relay.wait_for(*["vehicle_command: px4_msgs/srv/VehicleCommand, a service"] * 2)
        for name in names:
            caller = ros.run(domain, str(ROOT / "tests" / "support" / "ros_caller.py"), name, str(arm), str(unknown))
            programs.append(caller)
            caller.wait_for("^all answered$")
            expected = [(arm, results.ACCEPTED), (unknown, results.UNSUPPORTED)]
            answers = [f"{name} {command} {int(result)} True" for command, result in expected]
            assert caller.printed.splitlines() == [*answers, "all answered"]
    interrupted(relay)
    assert all(f"2 calls of {name} answered" in relay.printed for name in names)


@pytest.mark.night  # in ROS 2
@pytest.mark.tools("g++")
def test_the_relay_names_both_definitions(px4_types: Any, ros: Ros, programs: list[Program]) -> None:
    address = f"udp://127.0.0.1:{free_port()}"
    types = str(ROOT / "generated" / "px4_types")
    relay = ros.run(next(DOMAINS), "-m", "msggen", "relay", "airspeed_validated", "--link", address, "--types", types)
    programs.append(relay)
    with Simulator(px4_types, address, [Options(sync="short")]):
        info = px4_types.AirspeedValidated.__msg__
        relay.wait_for(
            "L105 no topic can be carried: /fmu/out/airspeed_validated_v1: the vehicle has version 1 "
            rf"\({info.message_hash:#010x}\), and px4_msgs/msg/AirspeedValidated has "
        )
        assert relay.process.wait(30) == 2
