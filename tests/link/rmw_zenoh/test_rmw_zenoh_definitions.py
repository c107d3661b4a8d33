"""Tests of the table of definitions by their hashes."""

from __future__ import annotations

import pytest

from msggen.link.rmw_zenoh.definitions import NEWEST, Definition, definition_of, release_of
from support.live_releases import DEFINITIONS, definitions
from support.zenoh_space import STATUS, definition, key_of


def test_the_table_is_up_to_date() -> None:
    assert DEFINITIONS.read_text() == definitions(), "run `python tests/support/live_releases.py` and commit it"


def test_a_hash_stands_for_a_definition() -> None:
    found = definition_of(STATUS.type_hash, "VehicleStatus")
    assert found == Definition("VehicleStatus", (None, None, None, None, 4), 0x53EE3679, 83)
    assert found.named("/fmu/out/vehicle_status", NEWEST) == "/fmu/out/vehicle_status_v4"
    assert found._replace(versions=(None, None, 0, None, None)).named("/fmu/out/x", NEWEST) == "/fmu/out/x"
    assert definition_of(STATUS.type_hash, "Wind") is None
    assert definition_of("TypeHashNotSupported", "VehicleStatus") is None


@pytest.mark.parametrize(("release", "name"), [(-2, "vehicle_command_ack"), (-1, "vehicle_command_ack_v1")])
def test_the_release_tells_the_version_of_a_definition_that_two_have(release: int, name: str) -> None:
    """VehicleCommandAck got a version in v1.18, and kept its fields."""
    answer = definition(key_of("VehicleCommandAck", 1, "/fmu/out/vehicle_command_ack"))
    assert answer.versions[-2:] == (0, 1)
    assert answer.named("vehicle_command_ack", release) == name


@pytest.mark.parametrize(("version", "release"), [(1, 3), (4, 4)])
def test_most_definitions_tell_the_release(version: int, release: int) -> None:
    keys = key_of("VehicleStatus", version, ""), key_of("VehicleCommandAck", 1, "")
    assert release_of((each.type_hash, each.ros_type.rpartition("/")[2]) for each in keys) == release


def test_without_definitions_the_release_is_the_newest() -> None:
    assert release_of([]) == NEWEST
