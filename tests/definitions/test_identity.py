"""Tests of identities: hashes, ids, sizes and names equal those of the firmware and of rosidl, for every release."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from msggen.definitions.identity import Endpoint, endpoints
from msggen.definitions.model import Catalog
from msggen.sources import finding as sources
from msggen.sources.catalog import read_catalog
from msggen.sources.conventions import CONVENTIONS, as_shown
from msggen.sources.finding import find_sources
from support.catalogs import catalog_of, write_definitions
from support.identities import assert_same_endpoints, dds_of, rihs01_of, uorb_of
from support.repository import shared

RELEASES = ["v1.14", "v1.16", "v1.17", "v1.18", "main-2026-03"]


def release_catalog(release: str) -> Catalog:
    return read_catalog(find_sources(str(shared(f"firmware/{release}"))))


def load(path: Path) -> Any:
    return json.loads(path.read_text())


@pytest.mark.slow
@pytest.mark.parametrize("release", RELEASES)
def test_uorb_of_every_release(release: str) -> None:
    assert uorb_of(release_catalog(release)) == load(shared(f"oracles/uorb-{release}.json"))


@pytest.mark.slow
@pytest.mark.parametrize("release", RELEASES)
def test_the_bridge_of_every_release(release: str) -> None:
    assert_same_endpoints(dds_of(release_catalog(release)), load(shared(f"oracles/dds-{release}.json")))


@pytest.mark.parametrize("release", ["v1.16", "v1.17", "v1.18"])
def test_ros_type_hashes_of_every_release(release: str) -> None:
    assert rihs01_of(release_catalog(release)) == load(shared(f"oracles/rihs01-{release}.json"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("release", "recognised"),
    [
        ("v1.14", "v1.14"),
        ("v1.15", "v1.15"),
        ("v1.16", "v1.16"),
        ("v1.17", "v1.16"),
        ("main-2026-03", "v1.16"),
        ("v1.18", "v1.18"),
    ],
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
        "  - {topic: /robot/fmu/in/odometry, type: 'px4_msgs::msg::Odometry'}\n"
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


NO_LIMIT = ["0", "0.0", "-5", "unlimited", "Unlimited", "off", '"off"', "OFF", "none", "' None '", "false", "-.inf"]
"""All spellings of "no limit" that PX4's script accepts."""


def limited(rate: str, release: str, folder: Path) -> Endpoint:
    """Return an endpoint with a rate limit, spelled as in the YAML."""
    entry = f"{{topic: /fmu/out/aim, type: 'px4_msgs::msg::Aim', rate_limit: {rate}}}"
    write_definitions(folder, {"msg/Aim.msg": "uint64 timestamp\n", "dds_topics.yaml": f"publications:\n  - {entry}\n"})
    return endpoints(read_catalog(find_sources(str(folder), release=release)))[0]


@pytest.mark.parametrize("rate", NO_LIMIT)
def test_no_limit_has_many_spellings(rate: str, tmp_path: Path) -> None:
    endpoint = limited(rate, "v1.18", tmp_path)
    assert (endpoint.entry.rate_limit_hz, endpoint.publish_interval_ms) == (0.0, 0)
    assert limited(rate, "v1.17", tmp_path).publish_interval_ms == 10


@pytest.mark.parametrize(
    ("rate", "since_july_2026", "before"),
    [
        ("null", 4, 10),
        ("100", 10, 10),
        ("30", 33, 33),
        ("60", 17, 16),
        ("400", 2, 2),
        ("666.6", 2, 1),
        ("2000", 1, 0),
        ("0.5", 2000, 2000),
        ("true", 1000, 1000),
        (".inf", 1, 0),
    ],
)
def test_a_rate_limit_is_an_interval_in_milliseconds(
    rate: str, since_july_2026: int, before: int, tmp_path: Path
) -> None:
    assert limited(rate, "v1.18", tmp_path).publish_interval_ms == since_july_2026
    assert limited(rate, "v1.16", tmp_path).publish_interval_ms == before


def test_a_reader_keeps_a_queue_for_each_of_its_sources(tmp_path: Path) -> None:
    entry = "{topic: /fmu/in/aim, type: 'px4_msgs::msg::Aim'"
    files = {
        "msg/Aim.msg": "uint8 ORB_QUEUE_LENGTH = 3\nuint64 timestamp\nuint8 id\n",
        "dds_topics.yaml": (
            f"subscriptions:\n  - {entry}}}\n"
            f"subscriptions_multi:\n  - {entry.replace('in/', 'in/a/')}, route_field: id, max_instances: 5}}\n"
            f"  - {entry.replace('in/', 'in/b/')}}}\n"
        ),
    }
    found = endpoints(catalog_of(tmp_path, files))
    assert [(each.reader_qos.depth, each.entry.route_field, each.entry.multi) for each in found] == [
        (6, None, False),
        (15, "id", True),
        (6, None, True),
    ]
    assert [each.object_id for each in found] == [2048, 2049, 2050]


# Behaviour found in the sources of the bridge's client

HEADER = """
#define UXRCE_DEFAULT_POLL_INTERVAL_MS 7
  @(pub['publish_interval_ms'])
  case @(idx)+ (65535U / 32U) + 1: {
"""
UTILITIES = 'snprintf(version, n, "_v%u", v); snprintf(name, n, "rt/%s%s", topic, version);'
OLD_HEADER = "#define UXRCE_DEFAULT_POLL_RATE 20\n case @(idx)+1000: {\n"
OLD_UTILITIES = 'snprintf(topic, n, "rt/fmu/%s/%s", direction, name);'


@pytest.mark.parametrize("release", [*CONVENTIONS])
@pytest.mark.parametrize(
    ("header", "utilities", "shown"),
    [
        (HEADER, UTILITIES, (2048, True, True, 7, True)),
        (OLD_HEADER, OLD_UTILITIES, (1000, False, False, 20, False)),
    ],
)
def test_what_the_client_shows_counts_before_the_release(
    header: str, utilities: str, shown: tuple[object, ...], release: str
) -> None:
    assert as_shown(CONVENTIONS[release], header, utilities)[1:] == shown


def test_a_client_that_shows_nothing_changes_nothing() -> None:
    assert as_shown(CONVENTIONS["v1.18"], "", "") == CONVENTIONS["v1.18"]


def test_a_tree_is_read_with_its_client(tmp_path: Path) -> None:
    client = "src/modules/uxrce_dds_client"
    files = {**BRIDGED, f"{client}/dds_topics.h.em": OLD_HEADER, f"{client}/utilities.hpp": OLD_UTILITIES}
    files[f"{client}/dds_topics.yaml"] = files.pop("dds_topics.yaml")
    found = endpoints(catalog_of(tmp_path, files))
    assert [(each.ros_name, each.object_id, each.publish_interval_ms) for each in found[1:3]] == [
        ("/fmu/out/odometry0", 1, 20),
        ("/fmu/in/odometry", 1000, None),
    ]


def test_the_releases_that_can_be_named_are_those_with_conventions() -> None:
    assert list(CONVENTIONS) == list(sources.RELEASES)
