"""Tests of the access control of a router: docs/zenoh.md has what vehicles and programs need."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import pytest

from msggen.link.rmw_zenoh.vehicles import NO_BEAT
from msggen.link.zenoh import ZenohLink
from msggen.live import Vehicle
from support.link_records import Records
from support.networked import networked
from support.repository import ROOT
from support.zenoh_space import session

pytest.importorskip("zenoh")

PAGE = (ROOT / "docs" / "zenoh.md").read_text(encoding="utf-8")


def written(folder: Path, **changes: str) -> str:
    """Write the configuration of the documentation, with other texts for some, and return its path."""
    text = re.findall(r"```json5\n(.*?)```", PAGE, re.DOTALL)[0]
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / "vehicle.json5"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_what_the_documentation_allows_is_enough_and_all_else_is_denied(px4_types: Any, tmp_path: Path) -> None:
    with networked(px4_types, config=written(tmp_path)) as space:
        port = int(space.url.rpartition(":")[2])
        with Vehicle(space.url, px4_types, direct=True) as vehicle:
            vehicle.wait_connected(20.0)
            vehicle.subscribe("vehicle_status").wait_for(lambda _: True, 10.0)
            home, end = vehicle.subscribe("home_position"), time.monotonic() + 20.0
            while home.latest() is None:  # a query
                assert time.monotonic() < end
            with vehicle.every(10, px4_types.OffboardControlMode()):
                while "/fmu/in/offboard_control_mode" not in space.simulator.vehicles[0].received:
                    assert time.monotonic() < end
                    time.sleep(0.01)
        got: list[str] = []
        with session(port) as reader, session(port) as writer:
            reader.declare_subscriber("**", lambda sample: got.append(str(sample.key_expr)))
            for name in ("0/allowed", "1/fmu/in/x", "other"):
                reader.declare_subscriber(name, lambda sample: got.append(str(sample.key_expr)))
            while "0/allowed" not in got:
                for name in ("1/fmu/in/x", "other", "0/allowed"):
                    writer.put(name, b"")
                assert time.monotonic() < end
                time.sleep(0.02)
        assert set(got) == {"0/allowed"}


def test_without_the_keys_of_beats_a_warning_names_them(px4_types: Any, tmp_path: Path) -> None:
    with networked(px4_types, config=written(tmp_path, **{', "@msggen/**"': ""})) as space:
        link, records = ZenohLink(port=int(space.url.rpartition(":")[2])), Records()
        link.start(records)
        try:
            records.wait(lambda: records.warnings)
        finally:
            link.close()
        assert NO_BEAT in records.warnings[0]


def test_who_may_only_read_cannot_command(px4_types: Any, tmp_path: Path) -> None:
    with (
        networked(px4_types, config=written(tmp_path, **{"0/**": "0/**/fmu/out/**"})) as space,
        Vehicle(space.url, px4_types, direct=True) as vehicle,
    ):
        vehicle.wait_connected(20.0)
        status = vehicle.subscribe("vehicle_status")
        with vehicle.every(50, px4_types.OffboardControlMode()):
            for _ in range(5):
                status.wait_for(lambda _: True, 10.0)
        assert "/fmu/in/offboard_control_mode" not in space.simulator.vehicles[0].received
