"""Hashes, ids, sizes and names equal those of the firmware and of rosidl, for every release."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from conftest import VECTORS, catalog_of, shared

from msggen.firmware import source
from msggen.firmware.catalog import read_catalog
from msggen.firmware.release import CONVENTIONS
from msggen.firmware.source import find_sources
from msggen.identity import endpoints, message_hash, type_hash, uorb_topics
from msggen.layout import lay_out, struct_size
from msggen.model import Catalog

RELEASES = ["v1.14", "v1.16", "v1.17", "main-2026-03"]


def release_catalog(release: str) -> Catalog:
    return read_catalog(find_sources(str(shared(f"firmware/{release}"))))


def load(path: Path) -> Any:
    return json.loads(path.read_text())


def uorb_of(catalog: Catalog) -> dict[str, Any]:
    ids = {topic.name: topic.orb_id for topic in uorb_topics(catalog)}
    messages = {
        message.name: {
            "cdr_size": lay_out(catalog, message).size,
            "message_hash": message_hash(catalog, message),
            "orb_ids": {topic: ids[topic] for topic in sorted(message.topic_names)},
            "queue_length": message.queue_length,
            "struct_size_no_padding": struct_size(catalog, message),
            "topics": list(message.topic_names),
        }
        for message in catalog.messages.values()
    }
    return {"messages": messages, "orb_ids": ids}


def dds_of(catalog: Catalog) -> list[dict[str, Any]]:
    return [
        {
            "direction": endpoint.entry.direction.value,
            "yaml_topic": endpoint.entry.topic,
            "type": endpoint.message.name,
            "dds_topic": endpoint.dds_name,
            "dds_type": endpoint.message.dds_type,
            "message_version": endpoint.message.message_version,
            "object_id": endpoint.object_id,
            "cdr_size": lay_out(catalog, endpoint.message).size,
            "rate_limit_hz": endpoint.entry.rate_limit_hz,
        }
        for endpoint in endpoints(catalog)
    ]


def rihs01_of(catalog: Catalog) -> dict[str, str]:
    return {message.name: type_hash(catalog, message) for message in catalog.messages.values()}


def without_orb_id(entries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in entry.items() if key != "orb_id"} for entry in entries]


def test_the_embedded_set_is_v1_17(embedded: Catalog) -> None:
    assert uorb_of(embedded) == load(VECTORS / "uorb.json")
    assert rihs01_of(embedded) == load(VECTORS / "rihs01.json")


def test_the_embedded_bridge_is_that_of_v1_17_and_debug_vect(embedded: Catalog) -> None:
    found = dds_of(embedded)
    assert found[:-1] == without_orb_id(load(VECTORS / "dds.json"))
    assert found[-1]["yaml_topic"] == "/fmu/in/debug_vect"
    assert found[-1]["object_id"] == found[-2]["object_id"] + 1


@pytest.mark.parametrize("release", RELEASES)
def test_uorb_of_every_release(release: str) -> None:
    assert uorb_of(release_catalog(release)) == load(shared(f"oracles/uorb-{release}.json"))


@pytest.mark.parametrize("release", RELEASES)
def test_the_bridge_of_every_release(release: str) -> None:
    assert dds_of(release_catalog(release)) == without_orb_id(load(shared(f"oracles/dds-{release}.json")))


@pytest.mark.parametrize("release", ["v1.16", "v1.17"])
def test_ros_type_hashes_of_every_release(release: str) -> None:
    assert rihs01_of(release_catalog(release)) == load(shared(f"oracles/rihs01-{release}.json"))


@pytest.mark.parametrize(
    ("release", "recognised"), [("v1.14", "v1.14"), ("v1.16", "v1.16"), ("v1.17", "v1.16"), ("main-2026-03", "v1.16")]
)
def test_releases_are_recognised_by_their_conventions(release: str, recognised: str) -> None:
    assert release_catalog(release).conventions.release == recognised


BRIDGED = {
    "msg/versioned/Odometry.msg": "uint32 MESSAGE_VERSION = 2\nuint64 timestamp\n",
    "dds_topics.yaml": (
        "publications:\n"
        "  - {topic: /fmu/out/odometry, type: 'px4_msgs::msg::Odometry', instance: 1}\n"
        "  - {topic: /fmu/out/odometry, type: 'px4_msgs::msg::Odometry', instance: 0}\n"
        "subscriptions:\n"
        "  - {topic: /fmu/in/odometry, type: 'px4_msgs::msg::Odometry'}\n"
        "subscriptions_multi:\n"
        "  - {topic: /robot/fmu/in/odometry, type: 'px4_msgs::msg::Odometry', rate_limit: unlimited}\n"
    ),
    "msg/Aim.msg": "uint64 timestamp\n",
}


def test_instances_number_their_topic_before_its_version(tmp_path: Path) -> None:
    found = [(endpoint.ros_name, endpoint.object_id) for endpoint in endpoints(catalog_of(tmp_path, BRIDGED))]
    assert found == [
        ("/fmu/out/odometry1_v2", 1 + 1 * 2),
        ("/fmu/out/odometry0_v2", 1),
        ("/fmu/in/odometry_v2", 2048),
        ("/robot/fmu/in/odometry_v2", 2049),
    ]


@pytest.mark.parametrize(
    ("release", "name", "first_id"),
    [
        ("v1.14", "/fmu/in/odometry", 1000),
        ("v1.15", "/robot/fmu/in/odometry", 2048),
        ("main", "/robot/fmu/in/odometry_v2", 2048),
    ],
)
def test_a_release_that_is_given_overrules_the_tree(release: str, name: str, first_id: int, tmp_path: Path) -> None:
    catalog_of(tmp_path, BRIDGED)
    last = endpoints(read_catalog(find_sources(str(tmp_path), release=release)))[-1]
    assert (last.ros_name, last.object_id) == (name, first_id + 1)


def test_a_rate_limit_of_zero_or_unlimited_is_none_at_all(tmp_path: Path) -> None:
    assert endpoints(catalog_of(tmp_path, BRIDGED))[-1].entry.rate_limit_hz == 0.0


def test_the_releases_that_can_be_named_are_those_with_conventions() -> None:
    assert list(CONVENTIONS) == list(source.RELEASES)
