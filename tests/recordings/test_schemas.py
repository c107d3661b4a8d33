"""Tests of the hashes of recorded definitions, and of the definitions of a running vehicle."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from msggen.exports.recorder import Definitions
from msggen.link.link import Route
from msggen.live import Vehicle
from msggen.recordings.decode.schemas import hash_of
from support.fake_link import FakeLink
from support.recordings import channel_of, route_of


def none(_: str) -> ModuleType:
    pytest.fail("no other release is needed")


def test_the_hash_of_a_recorded_definition_is_that_of_its_message(px4_types: Any) -> None:
    for name in px4_types.msg.__all__:
        info = getattr(px4_types, name).__msg__
        assert hash_of(info.ros_type, info.definition) == info.message_hash
        assert hash_of(info.ros_type.replace("/msg/", "/"), info.definition.replace("\n", "\r\n")) == info.message_hash


@pytest.mark.parametrize("text", ["", "uint8", "EscReport[8] esc\n", "Mine[2] mine\n", "\0", "uint8 a b c\n"])
def test_other_texts_have_none(text: str) -> None:
    assert hash_of("px4_msgs/msg/Mine", text) is None


def vehicle_with(link: FakeLink, package: Any, hashes: dict[str, int] | None) -> Definitions:
    """Return the definitions of a vehicle that tells hashes, or none."""
    vehicle = Vehicle(link, package)
    remote = link.connect()
    link.sample(remote, package.VehicleStatus())
    if hashes is not None:
        link.answer(remote, hashes)
    definitions = Definitions(vehicle, package, none)
    assert definitions.is_complete() == (hashes is not None)
    return definitions


def test_definitions_are_those_of_the_package(px4_types: Any) -> None:
    for definitions in (
        vehicle_with(FakeLink(px4_types), px4_types, {}),
        vehicle_with(FakeLink(px4_types), px4_types, None),
    ):
        for topic in ("vehicle_status", "battery_status", "sensor_combined"):
            route = route_of(px4_types, topic)
            assert definitions.channel(route) == channel_of(px4_types, route)


def test_a_definition_with_another_hash_is_not_known(px4_types: Any) -> None:
    definitions = vehicle_with(FakeLink(px4_types), px4_types, {"sensor_combined": 5})
    route = route_of(px4_types, "sensor_combined")
    assert definitions.channel(route) == (route.name, route.ros_type, "", "")
    other = route_of(px4_types, "wind")
    assert definitions.channel(other) == channel_of(px4_types, other)


def test_topics_of_other_versions_and_unknown_ones_have_no_definition(px4_types: Any) -> None:
    definitions = vehicle_with(FakeLink(px4_types), px4_types, {})
    definitions._package_of = lambda _: px4_types
    for route in (
        Route("/fmu/out/vehicle_status_v9", "px4_msgs/msg/VehicleStatus", "out", 1),
        Route("/fmu/out/vehicle_status_v4", "px4_msgs/msg/Wind", "out", 1),
        Route("/fmu/out/mine", "my_msgs/msg/Mine", "out", 1),
    ):
        assert definitions.channel(route) == (route.name, route.ros_type, "", "")


def test_a_definition_is_taken_from_the_release_that_has_its_hash(px4_types: Any) -> None:
    """Firmware between two releases has some definitions of each."""
    from msggen.messages.firmware import releases

    own, (release, rows) = px4_types, list(releases().items())[1]
    name, row = next(
        (name, row)
        for name, row in rows.items()
        if any(
            each.ros_name == name and each.message.__msg__.message_hash != row.message_hash for each in own.topics.out
        )
    )
    link = FakeLink(own)
    asked: list[str] = []

    def package_of(release: str) -> Any:
        from types import SimpleNamespace

        asked.append(release)
        info = SimpleNamespace(
            ros_type=f"px4_msgs/msg/{row.message}",
            message_version=0 if "_v" not in name else int(name.rpartition("_v")[2]),
            message_hash=row.message_hash,
            definition="of that release\n",
            type_hash="RIHS01_1",
        )
        endpoint = SimpleNamespace(message=SimpleNamespace(__msg__=info))
        return SimpleNamespace(topics=SimpleNamespace(versions_of=lambda _: (endpoint,)))

    vehicle = Vehicle(link, own)
    remote = link.connect()
    link.sample(remote, own.VehicleStatus())
    link.answer(remote, {row.uorb_topic: row.message_hash})
    definitions = Definitions(vehicle, own, package_of)
    assert definitions.is_complete()
    route = route_of(own, row.uorb_topic)
    assert definitions.channel(route).definition == "of that release\n"
    assert asked == [release]
