"""How a simulated vehicle publishes, topic by topic, beside a real PX4 v1.18 (tests/sim/published.json).

The real one is a multicopter of PX4's own simulator: at rest in Hold, in the air in the mode of a program and in Land.
"""

from __future__ import annotations

import re
from typing import Any

import pytest

from msggen.sim import Options
from msggen.sim.disturbances import DISTURBANCES
from msggen.sim.parts import PARTS
from msggen.sim.publishing import Publication, Schedule
from support import published
from support.published import FIELDS, RATES, Topic
from support.repository import ROOT, shared


@pytest.fixture(scope="module")
def real() -> dict[str, Topic]:
    return published.load()


@pytest.fixture(scope="module")
def own(px4_types: Any) -> dict[str, Topic]:
    return published.simulated(px4_types, Options())


@pytest.fixture(scope="module")
def full(px4_types: Any) -> dict[str, Topic]:
    """A vehicle with all parts."""
    return published.simulated(px4_types, Options(parts=tuple(PARTS)))


def test_the_same_topics_are_published_at_a_rate_on_change_once_or_never(
    real: dict[str, Topic], own: dict[str, Topic]
) -> None:
    different = {name for name, topic in real.items() if own[name].how != topic.how}
    assert different == set()


def test_topics_have_the_rates_of_the_real_vehicle(real: dict[str, Topic], own: dict[str, Topic]) -> None:
    different = {
        name
        for name, topic in real.items()
        if own[name].rest != pytest.approx(topic.rest, rel=0.05, abs=1.6)
        or own[name].flight != pytest.approx(topic.flight, rel=0.05, abs=0.3)
    }
    assert different == {*RATES}


def test_fields_move_and_stand_still_as_those_of_the_real_vehicle(
    real: dict[str, Topic], own: dict[str, Topic]
) -> None:
    different = {(name, field): kinds for name, field, *kinds in published.different_fields(real, own)}
    accepted = {(name, field) for name, fields in FIELDS.items() for field in fields}
    assert {each: kinds for each, kinds in different.items() if each not in accepted} == {}
    assert accepted - different.keys() == set(), "no longer different"


def test_a_vehicle_with_all_parts_publishes_all_topics(full: dict[str, Topic]) -> None:
    silent = {name for name, topic in full.items() if topic.how in {"silent", "once"}}
    assert silent == set()
    assert full["input_rc"].flight == pytest.approx(10.0, rel=0.05)


def test_a_power_module_measures_the_current(own: dict[str, Topic], full: dict[str, Topic]) -> None:
    without, measured = (each["battery_status"].fields for each in (own, full))
    assert (without["time_remaining_s"], without["capacity"], without["discharged_mah"]) == ("nan", "zero", "zero")
    assert (measured["time_remaining_s"], measured["capacity"], measured["discharged_mah"]) == ("moves", "set", "moves")


def test_a_change_is_published_at_once_after_a_pause_and_the_next_one_after_the_shortest_interval() -> None:
    """As by the real one: vehicle_status at 9.056, 9.092 and 9.258 s, because of a mode, arming and a takeoff."""
    filler: Any = None
    schedule = Schedule([Publication("vehicle_status", "", 0, 504_000, filler, 200_000)], 0)
    times = []
    for now in range(0, 1_500_000, 4_000):
        if now in {1_040_000, 1_052_000}:
            schedule.hasten(["vehicle_status"], now)
        times += [now for _ in schedule.take(now)]
    assert times == [0, 504_000, 1_008_000, 1_040_000, 1_208_000]


def test_an_unknown_part_is_named(px4_types: Any) -> None:
    with pytest.raises(ValueError, match=r"no part 'gimbl', did you mean .gimbal..: there are airspeed, gimbal, "):
        published.simulated(px4_types, Options(parts=("gimbl",)))


@pytest.mark.night  # it can change with the files only
def test_the_facts_are_those_of_the_capture(px4_types: Any) -> None:
    path = shared("oracles/flight/session.json.gz")
    assert published.captured(path, px4_types) == published.load()


def test_the_page_compares_them(real: dict[str, Topic], own: dict[str, Topic]) -> None:
    page = (ROOT / "tests" / "sim" / "compared.md").read_text(encoding="utf-8")
    assert published.table(real, own) in page, "stale: python -m support.published, in the folder tests"


def test_the_page_lists_parts_and_disturbances() -> None:
    page = (ROOT / "docs" / "sim.md").read_text(encoding="utf-8")
    parts = re.findall(r"^\| `([\w-]+)` \| ", page.partition("| part | adds |")[2].partition("\n\n")[0], re.MULTILINE)
    assert parts == [*PARTS]
    assert all(topic in page for topics in PARTS.values() for topic in topics)
    assert all(f"| `{name}` | {effect} |" in page for name, effect in DISTURBANCES.items())
