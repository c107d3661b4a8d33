"""Tests of the link over DDS, with a participant in another process that looks like PX4 behind an agent."""

from __future__ import annotations

import builtins
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.link.age import LONGEST_NS
from msggen.link.dds import LOOPBACK, DdsLink, Endpoint, endpoint_of
from msggen.link.link import LinkError, Remote, Route, Service
from support.commands import run
from support.dds_vehicle import domains, vehicle
from support.imports import forget
from support.link_records import Records, nothing_is_left
from support.repository import ROOT

DOMAINS = domains(140)


@contextmanager
def linked(domain: int) -> Iterator[tuple[DdsLink, Records]]:
    link, records = DdsLink(domain), Records()
    link.start(records)
    try:
        yield link, records
    finally:
        link.close()


@pytest.mark.parametrize(
    ("topic", "type_name", "is_writer", "expected"),
    [
        ("rt/fmu/out/wind", "px4_msgs::msg::dds_::Wind_", True, ("", "/fmu/out/wind", "px4_msgs/msg/Wind", "out")),
        (
            "rt/a/b/fmu/in/x_v1",
            "px4_msgs::msg::dds_::X_",
            False,
            ("a/b", "/a/b/fmu/in/x_v1", "px4_msgs/msg/X", "in"),
        ),
        (
            "rq/uav_1/fmu/vehicle_commandRequest",
            "px4_msgs::srv::dds_::VehicleCommand_Request_",
            False,
            ("uav_1", "/uav_1/fmu/vehicle_command", "px4_msgs/srv/VehicleCommand_Request", "Request"),
        ),
        (
            "rr/fmu/vehicle_commandReply",
            "px4_msgs::srv::dds_::VehicleCommand_Response_",
            True,
            ("", "/fmu/vehicle_command", "px4_msgs/srv/VehicleCommand_Response", "Reply"),
        ),
        ("rt/fmu/out/wind", "px4_msgs::msg::dds_::Wind_", False, None),
        ("rt/fmu/in/x", "px4_msgs::msg::dds_::X_", True, None),
        ("rq/fmu/vehicle_commandRequest", "px4_msgs::srv::dds_::VehicleCommand_Request_", True, None),
        ("rq/fmu/vehicle_commandReply", "px4_msgs::srv::dds_::VehicleCommand_Request_", False, None),
        ("rt/fmu/out/wind", "Wind", True, None),
        ("rt/chatter", "std_msgs::msg::dds_::String_", True, None),
    ],
)
def test_names_tell_the_endpoint(topic: str, type_name: str, is_writer: bool, expected: Any) -> None:  # noqa: FBT001
    assert endpoint_of(topic, type_name, is_writer=is_writer) == (expected and Endpoint(*expected))


@pytest.mark.parametrize(
    "topic", ["rt/" + "fmu/in/" * 40_000 + "\n", "rq/" + "/fmu/" * 40_000, "rt/fmu/out/" + "a" * 250]
)
def test_a_name_that_is_too_long_belongs_to_no_vehicle(topic: str) -> None:
    assert endpoint_of(topic, "px4_msgs::msg::dds_::A_", is_writer=True) is None


def answered(records: Records, number: int) -> bool:
    return number in [reply[2] for reply in records.replies]


def test_a_vehicle_is_found_read_written_and_called(px4_types: Any) -> None:
    domain = next(DOMAINS)
    with vehicle(domain, "uav_1", "vehicle_status", "sensor_combined") as process:
        with nothing_is_left(), linked(domain) as (link, records):
            status = records.route("/uav_1/fmu/out/vehicle_status_v4")
            command = records.route("/uav_1/fmu/in/vehicle_command")
            service = records.route("/uav_1/fmu/vehicle_command")
            (remote,) = records.remotes
            assert remote == Remote(1, f"domain {domain}", 0, "uav_1", continued=False)
            assert status == Route("/uav_1/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "out", -1)
            assert isinstance(service, Service)
            expected = {
                endpoint.ros_name
                for endpoint in px4_types.topics.namespaced("uav_1")
                if endpoint.direction == "in" or endpoint.uorb_topic in {"vehicle_status", "sensor_combined"}
            } | {"/uav_1/fmu/vehicle_command"}
            records.wait(lambda: len(link.routes(remote)) == len(expected))
            assert {route.name for route in link.routes(remote)} == expected

            def read(route: Any) -> list[int]:
                of = px4_types.topics.endpoint(route.name.removeprefix("/uav_1")).message
                return [of.decode(sample.payload).timestamp for sample in records.samples if sample.route == route]

            records.wait(lambda: len(read(status)) >= 10)
            read_now = read(status)
            assert read_now == list(range(read_now[0], read_now[0] + len(read_now)))
            now = time.time_ns()
            assert now - 60e9 < records.samples[0].time <= now
            assert link.statistics().received >= 10

            assert isinstance(command, Route)
            sent = px4_types.VehicleCommand(command=400, param1=1.0).encode()
            link.publish(remote, command, sent)
            assert process.stdout is not None
            assert process.stdout.readline() == f"rt/uav_1/fmu/in/vehicle_command {sent.hex()}\n"

            for number in (5, 6):
                request = px4_types.srv.VehicleCommand.Request(request=px4_types.VehicleCommand(command=100 + number))
                link.call(remote, service, number, request.encode())
                records.wait(partial(answered, records, number))
                reply = px4_types.srv.VehicleCommand.Response.decode(records.replies[-1][3]).reply
                assert (reply.command, reply.target_system) == (100 + number, 7)
            assert records.warnings == []
            assert len(records.threads) == 1
        assert records.gone == [(remote, "the link was closed")]
        assert list(link.routes(remote)) == []
        with pytest.raises(LinkError, match="no longer connected"):
            link.publish(remote, command, sent)


def test_a_vehicle_that_leaves_and_comes_again_is_another_remote() -> None:
    domain = next(DOMAINS)
    with linked(domain) as (link, records):
        for _ in range(2):
            with vehicle(domain, "", "wind") as process:
                records.wait(lambda: len(records.remotes) > len(records.gone))
                records.wait(lambda: records.samples and records.samples[-1].remote == records.remotes[-1])
                assert process.stdin is not None
                process.stdin.close()
                process.wait()
                records.wait(lambda: len(records.remotes) == len(records.gone))
        assert [remote.number for remote in records.remotes] == [1, 2]
        assert [reason for _, reason in records.gone] == ["all its writers have left the domain"] * 2
        assert {route.name for _, route in records.opened_routes} >= {"/fmu/out/wind", "/fmu/vehicle_command"}
        assert list(link.routes(records.remotes[-1])) == []


@pytest.mark.night  # three participants
def test_namespaces_are_vehicles_and_two_vehicles_in_one_are_told() -> None:
    domain = next(DOMAINS)
    with vehicle(domain, "one", "wind"), vehicle(domain, "two", "wind"), linked(domain) as (_, records):
        records.wait(lambda: len({sample.remote for sample in records.samples}) == 2)
        assert {sample.remote.namespace: sample.route.name for sample in records.samples} == {
            "one": "/one/fmu/out/wind",
            "two": "/two/fmu/out/wind",
        }
        assert records.warnings == []
        with vehicle(domain, "one", "wind"):
            records.wait(lambda: records.warnings)
        (warning,) = records.warnings
        assert "/one/fmu/out/wind" in warning
        assert "namespace of its own" in warning


def test_routes_of_a_vehicle_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A participant may make and delete any number of writers, and the routes stay."""
    from msggen.link.cyclone import Found

    monkeypatch.setattr("msggen.link.dds.MAX_ENDPOINTS", 10)
    link, records = DdsLink(0), Records()
    participant: Any = SimpleNamespace(reader=lambda *_, **__: object())
    for number in range(50):
        topic = f"rt/fmu/out/topic_{number}"
        found = Found(
            number, is_writer=True, participant="px4", topic=topic, type="px4_msgs::msg::dds_::A_", is_reliable=False
        )
        link._found(found, participant, records)
        if number:
            link._gone(number, participant, records)
    assert len(records.opened_routes) == len(link._sources) == 10
    assert records.gone == []


def test_two_links_share_a_domain_and_one_outlives_the_other() -> None:
    domain = next(DOMAINS)
    with vehicle(domain, "", "wind"), nothing_is_left(), linked(domain) as (_, second):
        with linked(domain) as (_, first):
            first.wait(lambda: first.samples)
        second.wait(lambda: second.samples)
        count = len(second.samples)
        second.wait(lambda: len(second.samples) > count)
        assert first.warnings == second.warnings == []


def test_closing_at_once_and_twice_leaves_nothing() -> None:
    pytest.importorskip("cyclonedds")
    with linked(next(DOMAINS)):  # what cyclonedds itself keeps
        pass
    with nothing_is_left():
        for _ in range(5):
            with linked(next(DOMAINS)) as (link, _):
                pass
            link.close()
    with pytest.raises(LinkError, match="make another one"):
        link.start(Records())


def test_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    forget(monkeypatch, "cyclonedds", "msggen.link.cyclone")
    real = builtins.__import__

    def missing(name: str, *args: Any) -> Any:
        if name.startswith("cyclonedds"):
            raise ImportError(name)
        return real(name, *args)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(LinkError, match=r"pip install -e '.*\[dds\]'"):
        DdsLink(0).start(Records())


def test_bad_arguments_are_errors() -> None:
    with pytest.raises(LinkError, match="between 0 and 232"):
        DdsLink(233)
    pytest.importorskip("cyclonedds")
    with pytest.raises(LinkError, match="cannot join domain 139"):
        DdsLink(139, configuration="<CycloneDDS><Nonsense/></CycloneDDS>").start(Records())


def test_topics_are_listed_and_printed_over_dds() -> None:
    domain = next(DOMAINS)
    link = ["--link", f"dds://{domain}", "--types", str(ROOT / "generated" / "px4_types")]
    with vehicle(domain, "uav_1", "vehicle_status,nav_state=14"):
        outcome = run(["topic", "echo", "vehicle_status", "--field", "nav_state", "--once", *link])
        assert (outcome.code, outcome.stdout) == (0, "14 (OFFBOARD)\n---\n")
        assert "/uav_1/fmu/out/vehicle_status_v4\n" in run(["topic", "list", *link]).stdout


@pytest.mark.parametrize("is_reliable", [False, True], ids=["topic", "service"])
def test_a_sample_that_waited_too_long_is_not_delivered(is_reliable: bool) -> None:  # noqa: FBT001
    cyclone = pytest.importorskip("msggen.link.cyclone")
    lifespan = cyclone.REQUEST_LIFESPAN if is_reliable else LONGEST_NS
    type_name = "px4_msgs::msg::dds_::Wind_"
    participant = cyclone.Participant(next(DOMAINS), LOOPBACK)
    try:
        reader = participant.reader("rt/fmu/in/wind", type_name, is_reliable=is_reliable)
        writer = participant.writer("rt/fmu/in/wind", type_name, is_reliable=is_reliable)
        for number in range(5):
            writer.write(bytes([0, 1, 0, 0, number, 0, 0, 0]))
        assert participant.wait(10.0)[1] == [reader]
        assert [data[4] for data in reader.take()] == [0, 1, 2, 3, 4]
        writer.write(bytes([0, 1, 0, 0, 5, 0, 0, 0]))
        time.sleep(lifespan / 1e9 + 0.2)  # more than that only makes it older
        writer.write(bytes([0, 1, 0, 0, 6, 0, 0, 0]))
        assert [data[4] for data in reader.take()] == [6]
    finally:
        participant.close()
