"""Tests of what is relayed: the types that are installed decide."""

from __future__ import annotations

from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.link.link import Service
from msggen.ros.plan import Plan, Topics, Wish, planned
from support.fake_link import SERVICE, routes_of
from support.ros_types import class_with, px4_msgs_of, services_of

NAMED = SERVICE._replace(name="/uav_1/fmu/vehicle_command")
COMMAND_SERVICE = "px4_msgs/srv/VehicleCommand"


@pytest.fixture(scope="module")
def archived() -> dict[str, Any]:
    """Packages of two releases with their archived versions."""
    return {release: package_of(release) for release in ("v1.18", "v1.16")}


def topics_of(
    *packages: Any, namespace: str = "", hashes: dict[str, int] | None = None, services: tuple[Service, ...] = ()
) -> Topics:
    """Return the topics of a vehicle with the firmware of the first package."""
    return Topics(routes_of(packages[0], namespace), namespace, hashes or {}, packages, services)


def messages_of(package: Any) -> list[Any]:
    """Return the current messages of all topics."""
    return [endpoint.message for endpoint in package.topics.ENDPOINTS]


def test_all_topics_pass_unchanged_if_px4_msgs_has_the_definitions(px4_types: Any) -> None:
    plan = planned(topics_of(px4_types, namespace="uav_1"), Wish(), px4_msgs_of(messages_of(px4_types)))
    assert [row.name for row in plan.rows] == sorted(f"/uav_1{each.ros_name}" for each in px4_types.topics.ENDPOINTS)
    assert (plan.refused, plan.missing) == ((), ())
    for row in plan.rows:
        endpoint = px4_types.topics.endpoint(row.name)
        assert row.qos == (endpoint.qos.writer if endpoint.direction == "out" else endpoint.qos.reader)
        sample = row.theirs().encode()
        assert row.to_ros(sample) is sample
        assert row.to_vehicle(sample).encode() == sample


@pytest.mark.parametrize(
    ("patterns", "expected"),
    [
        (["vehicle_status"], {"/fmu/out/vehicle_status_v4"}),
        (["/uav_1/fmu/out/vehicle_status_v4"], {"/fmu/out/vehicle_status_v4"}),
        (["/fmu/in/vehicle_command*"], {"/fmu/in/vehicle_command", "/fmu/in/vehicle_command_mode_executor"}),
        (["mode_completed"], {"/fmu/in/mode_completed", "/fmu/out/mode_completed"}),
        (["wind", "vtx"], {"/fmu/out/wind", "/fmu/out/vtx"}),
    ],
)
def test_topics_are_chosen_by_names_and_patterns(px4_types: Any, patterns: list[str], expected: set[str]) -> None:
    topics = topics_of(px4_types, namespace="uav_1")
    assert {route.name for route in topics.chosen(patterns)} == {f"/uav_1{name}" for name in expected}


def test_a_name_of_no_topic_gets_a_hint(px4_types: Any) -> None:
    with pytest.raises(
        ValueError, match=r"^the vehicle has no topic 'vehicle_statsu', did you mean 'vehicle_status'\?"
    ):
        planned(topics_of(px4_types), Wish(["wind", "vehicle_statsu"]))


def test_what_differs_is_refused_and_both_are_named(archived: dict[str, Any]) -> None:
    new, old = archived["v1.18"], archived["v1.16"]
    plan = planned(topics_of(new), Wish(), px4_msgs_of(messages_of(old)))
    refused = dict(plan.refused)
    ours, theirs = new.VehicleStatus.__msg__, new.VehicleStatusV1.__msg__
    assert refused["/fmu/out/vehicle_status_v4"] == (
        f"the vehicle has version 4 ({ours.message_hash:#010x}), "
        f"and px4_msgs/msg/VehicleStatus is version 1 ({theirs.message_hash:#010x})"
    )
    assert "and px4_msgs/msg/SensorGps has no field '" in refused["/fmu/out/vehicle_gps_position"]
    assert "px4_msgs/msg/Vtx" in plan.missing
    carried = {row.route.ros_type.rpartition("/")[2] for row in plan.rows}
    before = {cls.__name__: cls.__msg__.message_hash for cls in messages_of(old)}
    assert carried == {cls.__name__ for cls in messages_of(new) if before.get(cls.__name__) == cls.__msg__.message_hash}
    assert 20 < len(carried) < len(messages_of(new))


def test_versions_are_translated_to_what_is_installed(archived: dict[str, Any]) -> None:
    """A program for `vehicle_status_v1` gets it from a vehicle with version 4."""
    new, old = archived["v1.18"], archived["v1.16"]
    find = px4_msgs_of(messages_of(old))
    plan = planned(topics_of(new, namespace="uav_1"), Wish(is_translated=True), find)
    rows = {row.name: row for row in plan.rows}
    row = rows["/uav_1/fmu/out/vehicle_status_v1"]
    assert "/uav_1/fmu/out/vehicle_status_v4" not in rows
    message = new.VehicleStatus(timestamp=5, nav_state=14, arming_state=2)
    expected = new.versions.convert(message, new.VehicleStatusV1).message
    assert row.to_ros(message.encode()) == expected.encode()
    assert old.VehicleStatus.decode(row.to_ros(message.encode())).nav_state == 14
    back = rows["/uav_1/fmu/in/vehicle_attitude_setpoint"]
    setpoint = old.VehicleAttitudeSetpoint(timestamp=5, yaw_sp_move_rate=0.5)
    assert back.to_vehicle(setpoint.encode()) == new.VehicleAttitudeSetpoint(timestamp=5, yaw_sp_move_rate=0.5)
    assert "/uav_1/fmu/out/vehicle_gps_position" in dict(plan.refused), "it changed without a version"


def test_an_old_vehicle_is_translated_with_a_newer_package(archived: dict[str, Any]) -> None:
    new, old = archived["v1.18"], archived["v1.16"]
    topics = topics_of(old, new)
    assert planned(topics, Wish(["vehicle_status"]), px4_msgs_of(messages_of(new))).rows == ()
    (row,) = planned(topics, Wish(["vehicle_status"], is_translated=True), px4_msgs_of(messages_of(new))).rows
    assert row.name == "/fmu/out/vehicle_status_v4"
    sample = old.VehicleStatus(timestamp=5, nav_state=14).encode()
    assert new.VehicleStatus.decode(row.to_ros(sample)).nav_state == 14


def test_both_versions_are_published_with_px4_msgs_old(archived: dict[str, Any]) -> None:
    new = archived["v1.18"]
    current, old = px4_msgs_of(messages_of(new)), px4_msgs_of([new.VehicleStatusV1], "px4_msgs_old")

    def find(name: str) -> Any:
        return current(name) or old(name)

    plan = planned(topics_of(new, new), Wish(["vehicle_status"], is_translated=True), find)
    names = [(row.name, row.ros.__name__) for row in plan.rows]
    assert sorted(names) == [
        ("/fmu/out/vehicle_status_v1", "VehicleStatusV1"),
        ("/fmu/out/vehicle_status_v4", "VehicleStatus"),
    ]
    beside = planned(topics_of(new, new), Wish(["vehicle_status"], is_translated=True, is_beside_agent=True), find)
    assert [row.name for row in beside.rows] == ["/fmu/out/vehicle_status_v1"], "an agent has the other one"
    assert planned(topics_of(new), Wish(is_beside_agent=True), find) == Plan((), (), (), {})


def test_a_vehicle_with_another_hash_is_refused(px4_types: Any) -> None:
    hashes = {"px4_msgs/msg/Wind": 0x12345678}
    plan = planned(topics_of(px4_types, hashes=hashes), Wish(["wind"]), px4_msgs_of(messages_of(px4_types)))
    own = px4_types.Wind.__msg__.message_hash
    assert plan.refused == (
        ("/fmu/out/wind", f"the vehicle's definition has the hash 0x12345678, and that of --types {own:#010x}"),
    )


def test_the_sources_of_standard_messages(px4_types: Any) -> None:
    found, refused = topics_of(px4_types, namespace="a").sources()
    assert {name: (source.name, source.message.__name__) for name, source in found.items()} == {
        "/a/fmu/out/vehicle_odometry": ("vehicle_odometry", "VehicleOdometry"),
        "/a/fmu/out/sensor_combined": ("sensor_combined", "SensorCombined"),
        "/a/fmu/out/vehicle_attitude": ("vehicle_attitude", "VehicleAttitude"),
        "/a/fmu/out/vehicle_gps_position": ("vehicle_gps_position", "SensorGps"),
    }
    assert refused == []
    found, refused = topics_of(px4_types, hashes={"px4_msgs/msg/SensorGps": 1}).sources()
    assert len(found) == 3
    plan = planned(topics_of(px4_types), Wish(is_standard=True, is_beside_agent=True), lambda _: None)
    assert plan == Plan((), (), (), topics_of(px4_types).sources()[0])
    assert [name for name, _ in refused] == ["/fmu/out/vehicle_gps_position"]


@pytest.mark.parametrize(
    ("patterns", "count"),
    [([], 1), (["vehicle_command"], 1), (["/fmu/vehicle_command"], 1), (["/fmu/out/*"], 0), (["w*"], 0)],
)
def test_a_service_is_carried_if_its_type_is_installed(px4_types: Any, patterns: list[str], count: int) -> None:
    topics = topics_of(px4_types, namespace="uav_1", services=(NAMED,))
    find = services_of(px4_types.srv.VehicleCommand)
    plan = planned(topics, Wish(patterns), find)
    assert [row.service for row in plan.services] == [NAMED] * count
    for row in plan.services:
        assert row.ros is find(COMMAND_SERVICE)
        assert row.request is px4_types.srv.VehicleCommand.Request
    assert planned(topics, Wish(patterns, is_beside_agent=True), find).services == (), "the agent has it"
    missing = planned(topics, Wish(patterns), lambda _: None)
    assert (COMMAND_SERVICE in missing.missing, missing.services) == (count == 1, ())


@pytest.mark.parametrize("vehicle", ["v1.18", "v1.17", "v1.16", "v1.15"])
@pytest.mark.parametrize("installed", ["v1.18", "v1.15"])
def test_the_service_is_the_same_in_all_releases(vehicle: str, installed: str) -> None:
    """VehicleCommandAck has a version 1 in v1.18, with the fields of version 0."""
    theirs, ours = package_of(vehicle), package_of(installed)
    hashes = {f"px4_msgs/msg/{cls.__name__}": cls.__msg__.message_hash for cls in messages_of(theirs)}
    topics = topics_of(theirs, hashes=hashes, services=(SERVICE,))
    (row,) = planned(topics, Wish(["vehicle_command"]), services_of(ours.srv.VehicleCommand)).services
    assert row.response is theirs.srv.VehicleCommand.Response


def test_a_service_that_differs_is_refused(px4_types: Any) -> None:
    service = px4_types.srv.VehicleCommand
    find = services_of(service)
    topics = topics_of(px4_types, services=(SERVICE,))
    ack = find("px4_msgs/msg/VehicleCommandAck").get_fields_and_field_types()
    other = class_with({name: kind for name, kind in ack.items() if name != "result_param2"})

    def differing(name: str) -> Any:
        return other if name == "px4_msgs/msg/VehicleCommandAck" else find(name)

    wish = Wish(["/fmu/vehicle_command"])
    reasons = [
        (
            planned(topics, wish, differing),
            "the vehicle's definition differs, and px4_msgs/srv/VehicleCommand has no field 'reply.result_param2'",
        ),
        (
            planned(topics._replace(hashes={"px4_msgs/msg/VehicleCommand": 7}), wish, find),
            "the vehicle has another definition of VehicleCommand than --types",
        ),
        (
            planned(topics._replace(services=(SERVICE._replace(request_type="a/srv/Other_Request"),)), wish, find),
            "not in the definitions of --types",
        ),
    ]
    for plan, reason in reasons:
        assert (plan.services, plan.refused) == ((), ((SERVICE.name, reason),))


def test_the_answer_to_a_call_that_failed(px4_types: Any) -> None:
    (row,) = planned(
        topics_of(px4_types, services=(SERVICE,)),
        Wish(["/fmu/vehicle_command"]),
        services_of(px4_types.srv.VehicleCommand),
    ).services
    command = px4_types.VehicleCommand(command=400)
    answer: Any = row.failure(px4_types.srv.VehicleCommand.Request(request=command), "FAILED")
    assert answer.reply == px4_types.VehicleCommandAck(command=400, result=4)
    assert row._replace(response=px4_types.VehicleCommand).failure(command, "FAILED") is None
