"""Tests of the table of definitions by their hashes."""

from __future__ import annotations

from msggen.link.rmw_zenoh.definitions import Definition, definition_of
from support.live_releases import DEFINITIONS, definitions
from support.zenoh_space import STATUS


def test_the_table_is_up_to_date() -> None:
    assert DEFINITIONS.read_text() == definitions(), "run `python tests/support/live_releases.py` and commit it"


def test_a_hash_stands_for_a_definition() -> None:
    found = definition_of(STATUS.type_hash, "VehicleStatus")
    assert found == Definition("VehicleStatus", 4, 0x53EE3679, 83)
    assert found.named("/fmu/out/vehicle_status") == "/fmu/out/vehicle_status_v4"
    assert found._replace(version=0).named("/fmu/out/x") == "/fmu/out/x"
    assert definition_of(STATUS.type_hash, "Wind") is None
    assert definition_of("TypeHashNotSupported", "VehicleStatus") is None
