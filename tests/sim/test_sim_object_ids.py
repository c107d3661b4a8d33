"""Tests of the object ids of simulated boards: compared with those of both kinds of boards of PX4 v1.18."""

from __future__ import annotations

import json
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from msggen.generate.cache import package_of
from msggen.sim.endpoints import object_ids_of
from msggen.sources.embedded import EMBEDDED
from support.repository import ROOT, shared


def endpoints() -> list[dict[str, Any]]:
    """Return the endpoints of v1.18, with the ids of boards without the conditional messages and of those with them."""
    vectors = json.loads((ROOT / "tests" / "vectors" / "v1.18.json").read_text())
    return [dict(zip(vectors["endpoint_columns"], row, strict=True)) for row in vectors["endpoints"]]


def shared_endpoints() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(shared("oracles/dds-v1.18.json").read_text())
    return found


@pytest.mark.parametrize("measured", [endpoints, shared_endpoints])
def test_the_ids_are_those_of_both_kinds_of_boards(px4_types: Any, measured: Any) -> None:
    by_name = {row["dds_topic"]: row for row in measured()}
    rows = [by_name[endpoint.dds_name] for endpoint in px4_types.topics.ENDPOINTS]
    most, simulator = both(px4_types.topics)
    assert most == tuple(row["object_id_unconditional"] for row in rows)
    assert simulator == tuple(row["object_id"] for row in rows)
    differ = [one != other for one, other in zip(most, simulator, strict=True)]
    assert (sum(differ), len(differ)) == (24, 69)


@pytest.mark.parametrize("release", EMBEDDED[1:])
def test_a_release_without_conditions_has_the_same_on_all_boards(release: str) -> None:
    package = package_of(release)
    numbers = tuple(endpoint.object_id for endpoint in package.topics.ENDPOINTS)
    assert both(package.topics) == (numbers, numbers)


def both(topics: Any) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the ids of most boards, and of those with all messages."""
    return object_ids_of(topics), object_ids_of(topics, has_all=True)


def topics_with(conditions: Mapping[str, str], *bridged: tuple[str, str, int | None]) -> Any:
    """Return a module `topics` with uORB topics and their conditions, of which some cross the bridge."""
    uorb = {
        name: SimpleNamespace(name=name, orb_id=place, condition=conditions[name])
        for place, name in enumerate(sorted(conditions))
    }
    crossing = [
        SimpleNamespace(uorb_topic=name, direction=direction, instance=instance, object_id=2048)
        for name, direction, instance in bridged
    ]
    return SimpleNamespace(UORB=uorb, ENDPOINTS=crossing)


def test_conditions_shift_the_ids() -> None:
    topics = topics_with({"a": "A", "b": "B", "c": "B", "d": ""}, ("d", "out", None), ("d", "in", None))
    assert both(topics) == ((0, 2048), (3, 2048))


def test_an_instance_counts_the_topics_that_the_board_has() -> None:
    topics = topics_with({"a": "", "b": "B"}, ("a", "out", None), ("a", "out", 2))
    assert both(topics) == ((0, 2), (0, 4))


def test_the_conditions_of_bridged_topics_are_met() -> None:
    topics = topics_with({"a": "A", "b": "B", "c": "B"}, ("c", "out", None))
    assert both(topics) == ((1,), (2,))
