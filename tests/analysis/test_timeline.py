"""Tests of what happened when: the modes of programs have the names with which they were registered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.analysis.flight import flight_of
from msggen.analysis.timeline import timeline_of
from support import flight_captures
from support.written import write_recording

EXTERNAL1, EXTERNAL2 = 23, 24


def named(name: str) -> bytes:
    return name.encode().ljust(25, b"\0")


def modes_of(path: Path) -> list[tuple[str, float]]:
    with recordings.open(str(path)) as log:
        flight = flight_of(log, lambda _: False)
        return [(each.name, each.begin) for each in timeline_of(flight.recorded).modes]


def written(path: Path, px4_types: Any, modes: dict[float, int], replies: list[tuple[float, str, int, bool]]) -> Path:
    status, reply = px4_types.VehicleStatus, px4_types.RegisterExtComponentReply
    samples = [("/fmu/out/vehicle_status", time, status(nav_state=mode)) for time, mode in modes.items()]
    samples += [
        ("/fmu/out/register_ext_component_reply", time, reply(name=named(name), mode_id=mode, success=success))
        for time, name, mode, success in replies
    ]
    return write_recording(path, samples)


@pytest.mark.parametrize(
    ("replies", "expected"),
    [
        ([], ["Hold", "External 1", "Land"]),
        ([(0.5, "Circle", EXTERNAL1, True)], ["Hold", "Circle", "Land"]),
        ([(1.5, "Circle", EXTERNAL1, True)], ["Hold", "Circle", "Land"]),  # selected before the reply arrived
        ([(0.5, "Circle", EXTERNAL2, True)], ["Hold", "External 1", "Land"]),
        ([(0.5, "Circle", EXTERNAL1, False)], ["Hold", "External 1", "Land"]),
        ([(0.5, "", EXTERNAL1, True)], ["Hold", "External 1", "Land"]),
        ([(0.2, "Square", EXTERNAL1, True), (0.5, "Circle", EXTERNAL1, True)], ["Hold", "Circle", "Land"]),
        ([(0.5, "Circle", EXTERNAL1, True), (2.5, "Square", EXTERNAL1, True)], ["Hold", "Circle", "Land"]),
        ([(0.5, "Return", EXTERNAL1, True)], ["Hold", "Return (External 1)", "Land"]),
        ([(0.5, "Land", 18, True)], ["Hold", "External 1", "Land"]),
    ],
)
def test_a_mode_of_a_program_has_the_name_with_which_it_was_registered(
    replies: list[tuple[float, str, int, bool]], expected: list[str], tmp_path: Path, px4_types: Any
) -> None:
    path = written(tmp_path / "modes.mcap", px4_types, {0.0: 4, 1.0: EXTERNAL1, 2.0: 18, 3.0: 18}, replies)
    assert [name for name, _ in modes_of(path)] == expected


def test_a_slot_that_two_modes_used_has_both_names(tmp_path: Path, px4_types: Any) -> None:
    replies = [(0.5, "Circle", EXTERNAL1, True), (2.5, "Square", EXTERNAL1, True)]
    modes = {0.0: 4, 1.0: EXTERNAL1, 2.0: 4, 3.0: EXTERNAL1, 4.0: 4, 5.0: 4}
    found = modes_of(written(tmp_path / "both.mcap", px4_types, modes, replies))
    assert [name for name, _ in found] == ["Hold", "Circle", "Hold", "Square", "Hold"]
    assert [begin for _, begin in found] == pytest.approx([0, 1, 2, 3, 4])


@pytest.mark.parametrize(
    ("flight", "expected"),
    [
        ("session", ["Hold", "Python Goto", "Takeoff", "Land"]),
        ("replace-rtl", ["Hold", "Takeoff", "My RTL", "Return"]),
        ("register-armed", ["Hold", "Python", "Takeoff", "Return", "Second"]),
        ("killed-goto-0", ["Hold", "Takeoff", "External 1", "Return"]),  # registered before the capture
    ],
)
def test_modes_that_a_real_px4_registered_have_their_names(
    flight: str, expected: list[str], tmp_path: Path, px4_types: Any
) -> None:
    classes = {
        "/fmu/out/vehicle_status_v4": px4_types.VehicleStatus,
        "/fmu/out/register_ext_component_reply_v1": px4_types.RegisterExtComponentReply,
    }
    samples = [
        (topic, time, classes[topic].decode(bytes.fromhex(data)))
        for time, topic, data in flight_captures.load(flight).rows
        if topic in classes
    ]
    found = modes_of(write_recording(tmp_path / "flight.mcap", samples))
    assert list(dict.fromkeys(name for name, _ in found)) == expected
