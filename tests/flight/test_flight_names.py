"""Tests that names of other libraries are told with those of msggen."""

from __future__ import annotations

import re
import sys
from operator import attrgetter
from typing import Any

import pytest

import msggen.flight
from msggen.flight import BlockingFlight, Check, Executor, Flight, FlightError, Mode
from msggen.flight.blocking import BlockingOffboard, BlockingTelemetry
from msggen.flight.offboard import Offboard
from msggen.flight.telemetry import Telemetry
from msggen.flight.usage import ATTRIBUTES, IMPORTED, Hinted, told
from support.flown import Flown, flying
from support.repository import ROOT

FACADES = (Flight, BlockingFlight, Mode, Executor, Check, Offboard, BlockingOffboard, Telemetry, BlockingTelemetry)
PAGE = (ROOT / "docs" / "flight.md").read_text(encoding="utf-8")


def names_elsewhere() -> set[str]:
    """Return the names in the first two columns of the page's table."""
    table = PAGE.partition("## Names elsewhere")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:3] for line in table.splitlines() if line.startswith("| ")][1:]
    code = [text for row in rows for cell in row for text in re.findall(r"`([^`]+)`", cell)]
    return {re.split(r"[(:]", each)[0].rpartition(".")[2] for each in code}


def test_every_name_of_the_page_is_known_or_told() -> None:
    offered = {name for facade in FACADES for name in dir(facade)} | {*msggen.flight.__all__}
    assert len(names_elsewhere()) > 30
    assert names_elsewhere() - offered - ATTRIBUTES.keys() - IMPORTED.keys() - {"telemetry", "offboard"} == set()


@pytest.mark.parametrize("name", IMPORTED)
def test_an_import_of_another_library_tells_the_name(name: str) -> None:
    with pytest.raises(ImportError) as raised:
        exec(f"from msggen.flight import {name}")  # noqa: S102 - as a program does
    assert str(raised.value) == f"module 'msggen.flight' has no '{name}': in msggen, it is {IMPORTED[name]}"
    assert name not in msggen.flight.__all__


@pytest.mark.parametrize("name", [*IMPORTED, "Flihgt"])
def test_a_name_that_is_only_looked_for_is_no_error(name: str) -> None:
    assert not hasattr(msggen.flight, name)
    assert getattr(msggen.flight, name, None) is None
    with pytest.raises(AttributeError, match=f"module 'msggen.flight' has no '{name}'"):
        attrgetter(name)(msggen.flight)


def test_only_public_names_are_completed_and_modules_can_be_imported() -> None:
    assert dir(msggen.flight) == sorted(msggen.flight.__all__)
    sys.modules.pop("msggen.flight.usage")
    exec("from msggen.flight import usage, Flight, Mode")  # noqa: S102 - as above
    with pytest.raises(ImportError, match="cannot import name 'Flihgt'"):
        exec("from msggen.flight import Flihgt")  # noqa: S102 - as above
    with pytest.raises(AttributeError, match="has no 'Flihgt', did you mean 'Flight'"):
        attrgetter("Flihgt")(msggen.flight)


@pytest.mark.parametrize("facade", FACADES)
def test_every_counterpart_of_a_facade_is_told(facade: type) -> None:
    assert issubclass(facade, Hinted)
    for name, text in ATTRIBUTES.items():
        if hasattr(facade, name):
            continue
        with pytest.raises(AttributeError) as raised:
            getattr(facade.__new__(facade), name)
        assert str(raised.value) == f"{facade.__name__} has no '{name}': in msggen, it is {text}"
    with pytest.raises(AttributeError, match=rf"^{facade.__name__} has no 'xyzzy'$"):
        attrgetter("xyzzy")(facade.__new__(facade))
    assert not hasattr(facade.__new__(facade), "xyzzy")


@flying()
async def test_what_people_type_is_told(flight: Flight) -> None:
    for path, text in (
        ("return_to_launch", "in msggen, it is `return_home`"),
        ("telemetry.position", "`await global_position()` or `await local_position()`"),
        ("action.arm", "a method of the flight: `await flight.arm()`"),
        ("telemetry.subscribe_battery", "for each message: `flight.feeds[topic].call(function)`"),
        ("arm_async", "in msggen, it is `await arm(...)`"),
        ("takeof", "did you mean 'takeoff'"),
        ("telemetry.batery", "did you mean 'battery'"),
    ):
        with pytest.raises(AttributeError, match=re.escape(text)):
            attrgetter(path)(flight)


def test_a_flight_that_has_not_begun_says_so(px4_types: Any) -> None:
    with pytest.raises(FlightError, match="has not begun"):
        attrgetter("telemetry")(Flight(Flown(px4_types)))
    assert told("X", "schedule_mode", ()) == "X has no 'schedule_mode': in msggen, it is `await self.fly(mode)`"
