"""Tests of the finding that a recording ends in the air: only with evidence of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import flight_of
from msggen.analysis.rules.table import FLIGHT, TOPICS
from support.written import write_recording

RULE = next(rule for rule in FLIGHT if rule.id == "LOG_ENDS_IN_AIR")
ARMED = {"VehicleStatus": {"arming_state": 2}}
FLYING = {"VehicleLandDetected": {"landed": False}}


def at(down: float, **more: Any) -> dict[str, dict[str, Any]]:
    return {"VehicleLocalPosition": {"z": down, "z_valid": True, **more}}


@pytest.mark.parametrize(
    ("last", "expected"),
    [
        (ARMED | FLYING | at(-12.34), "the recording ends in the air, 12.3 m above where it armed"),
        (ARMED | FLYING, "the recording ends in the air"),
        (ARMED | FLYING | at(-12.34, z_valid=False), "the recording ends in the air"),
        (ARMED | FLYING | at(-0.3), "the recording ends before the vehicle has disarmed, 0.3 m above where it armed"),
        (ARMED | {"VehicleLandDetected": {"landed": True}} | at(-12.34), ""),  # the estimate drifted
        (ARMED | {"VehicleLandDetected": {"ground_contact": True}}, ""),  # a rover, or a landing
        (ARMED | {"VehicleLandDetected": {"maybe_landed": True}}, ""),
        ({"VehicleStatus": {"arming_state": 1}} | FLYING | at(-12.34), ""),
    ],
)
def test_a_recording_ends_in_the_air_if_the_vehicle_is_armed_and_has_no_contact(
    last: dict[str, dict[str, Any]], expected: str, tmp_path: Path, px4_types: Any
) -> None:
    first = ARMED | FLYING | at(0.0)
    topics = {
        "VehicleStatus": "vehicle_status",
        "VehicleLandDetected": "vehicle_land_detected",
        "VehicleLocalPosition": "vehicle_local_position",
    }
    samples = [
        (f"/fmu/out/{topics[name]}", time, getattr(px4_types, name)(**fields))
        for time, values in ((0.0, first), (4.0, last), (5.0, last))
        for name, fields in values.items()
    ]
    with recordings.open(str(write_recording(tmp_path / "end.mcap", samples))) as log:
        found = findings_of(flight_of(log, lambda name: name in TOPICS), [RULE])
    assert [each.text for each in found.findings] == ([expected] if expected else [])
    assert [each.level for each in found.findings] == (["info"] if expected else [])
    assert not found.silences


def test_without_an_arming_state_the_end_is_not_told(tmp_path: Path, px4_types: Any) -> None:
    samples = [("/fmu/out/vehicle_land_detected", float(time), px4_types.VehicleLandDetected()) for time in range(3)]
    with recordings.open(str(write_recording(tmp_path / "end.mcap", samples))) as log:
        found = findings_of(flight_of(log, lambda name: name in TOPICS), [RULE])
    assert not found.findings
    (silence,) = found.silences
    assert silence.reason == "the recording has no vehicle_status.arming_state or actuator_armed.armed"
