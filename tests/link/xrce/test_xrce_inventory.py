"""The entities of a client: the namespace in the participant's name, and the removal of entities with their parts."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fuzz import runner
from msggen.link.xrce import entities, wire
from msggen.link.xrce.entities import Endpoint, Entity, Group, Participant, RefusedError, TopicEntity, object_id
from msggen.link.xrce.inventory import Inventory

PARTICIPANT = object_id(1, entities.PARTICIPANT)
MANY = 0xFFF
"""The entities of a kind."""


@pytest.fixture
def seconds(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Allow a second of processor time."""
    monkeypatch.setattr(runner, "CPU_SECONDS", 1)
    with runner.limited():
        yield


def make(inventory: Inventory, identity: bytes, entity: Entity) -> None:
    inventory.create(wire.Create(b"\0\1", identity, entity.pack(), wire.LITTLE_ENDIAN | wire.REPLACE))


@pytest.mark.parametrize(
    ("name", "namespace"),
    [
        ("/px4_micro_xrce_dds", ""),
        ("px4_micro_xrce_dds", ""),
        ("uav_1/px4_micro_xrce_dds", "uav_1"),
        ("/fleet/uav_1/px4_micro_xrce_dds", "fleet/uav_1"),
        ("//a//b///px4_micro_xrce_dds", "a//b"),
        ("uav_1px4_micro_xrce_dds", "uav_1"),
        ("uav 1/px4_micro_xrce_dds", ""),
        ("uav_1/px4_micro_xrce_dds2", ""),
        ("px4_micro_xrce_dds/px4_micro_xrce_dds", "px4_micro_xrce_dds"),
        ("uav_1\n/px4_micro_xrce_dds", ""),
        ("px4_participant", ""),
        ("", ""),
        ("/" * 237 + "px4_micro_xrce_dds", ""),
        ("/" * 238 + "px4_micro_xrce_dds", ""),
    ],
)
def test_the_name_of_the_participant_tells_the_namespace(name: str, namespace: str) -> None:
    inventory = Inventory(10, 255)
    make(inventory, PARTICIPANT, Participant(name))
    assert inventory.namespace == namespace


@pytest.mark.usefixtures("seconds")
@pytest.mark.parametrize("name", ["/" * 100_000, "a" * 100_000, "/a" * 50_000, "px4_micro_xrce_dds" * 5_000 + "x"])
def test_the_namespace_takes_linear_time(name: str) -> None:
    inventory = Inventory(10, 100_000)
    make(inventory, PARTICIPANT, Participant(name))
    assert inventory.namespace == ""


@pytest.mark.usefixtures("seconds")
def test_a_participant_with_many_parts_is_removed_in_linear_time() -> None:
    inventory = Inventory(4 * MANY, 255)
    make(inventory, PARTICIPANT, Participant("/px4_micro_xrce_dds"))
    make(inventory, object_id(1, entities.TOPIC), TopicEntity("rt/a", "A", PARTICIPANT))
    for number in range(MANY):
        parent = object_id(number, entities.PUBLISHER)
        make(inventory, parent, Group(entities.PUBLISHER, PARTICIPANT))
        make(inventory, object_id(number, entities.WRITER), Endpoint(5, object_id(1, entities.TOPIC), parent))
    inventory.delete(PARTICIPANT)
    assert (len(inventory), inventory.writers) == (0, {})


@pytest.mark.usefixtures("seconds")
def test_many_entities_are_removed_in_linear_time() -> None:
    inventory = Inventory(2 * MANY, 255)
    make(inventory, PARTICIPANT, Participant("/px4_micro_xrce_dds"))
    for number in range(MANY):
        make(inventory, object_id(number, entities.PUBLISHER), Group(entities.PUBLISHER, PARTICIPANT))
    for number in range(MANY):
        inventory.delete(object_id(number, entities.PUBLISHER))
    assert len(inventory) == 1


def test_an_entity_is_removed_with_the_parent_that_it_had_last() -> None:
    inventory = Inventory(10, 255)
    make(inventory, PARTICIPANT, Participant("/px4_micro_xrce_dds"))
    topic, first, second = (object_id(1, 2), object_id(1, entities.PUBLISHER), object_id(2, entities.PUBLISHER))
    make(inventory, topic, TopicEntity("rt/a", "A", PARTICIPANT))
    for parent in (first, second):
        make(inventory, parent, Group(entities.PUBLISHER, PARTICIPANT))
        make(inventory, object_id(1, entities.WRITER), Endpoint(entities.WRITER, topic, parent))
    make(inventory, second, Group(entities.PUBLISHER, PARTICIPANT))  # which keeps its parts
    inventory.delete(first)
    assert len(inventory.writers) == 1
    inventory.delete(second)
    assert (len(inventory), inventory.writers) == (2, {})
    with pytest.raises(RefusedError, match="DELETE of an unknown entity"):
        inventory.delete(object_id(1, entities.WRITER))
    make(inventory, second, Group(entities.PUBLISHER, PARTICIPANT))
    inventory.delete(PARTICIPANT)
    assert (len(inventory), inventory._parts) == (0, {})
