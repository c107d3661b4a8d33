"""Tests that the doctor finds the same however long it waits and watches, at the link and through its owner.

The time is simulated, so that each fault is looked at with many waits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast

import pytest

from msggen.doctor.decoding import decoded
from msggen.doctor.expected import Expected, expected_of
from msggen.doctor.watching import Plan, observe
from msggen.link.address import parse_address
from msggen.sim import Misbehaviour, Options
from msggen.vehicle.owned.places import CAN_SHARE
from msggen.vehicle.owned.unix import UnixLink
from support.faults import rules_of
from support.findings import ids, judged
from support.link_records import nothing_is_left
from support.served import served
from support.simulated_link import SimulatedLink

ADDRESS = parse_address("udp://127.0.0.1:8888")
CALM = Options(sync="short", rate=5.0)
WAITS = (0.2, 1.0, 2.0, 3.0, 5.0, 8.0, 11.0, 12.0, 13.0, 14.0, 20.0, 30.0, 40.0)
SECONDS = (0.5, 2.0, 5.0, 10.0)
CONNECTED = 4.0
"""The wait in s in which a vehicle connects."""


class Row(NamedTuple):
    """Vehicles with a fault."""

    vehicles: tuple[Options, ...]
    wait: float = CONNECTED
    """The shortest wait in s, and the shortest watch, that show the fault."""
    watch: float = 0.0


def _row(wait: float = CONNECTED, watch: float = 0.0, *vehicles: Options, **wrong: Any) -> Row:
    return Row(vehicles or (CALM._replace(misbehaviour=Misbehaviour(**wrong)),), wait, watch)


ROWS = {
    "nothing": Row((), 0.0),
    "deaf": _row(0.0, no_time_reply=True),
    "early": Row((CALM._replace(sync="px4", misbehaviour=Misbehaviour(restart_every=2.0)),), 0.0),
    "restart": _row(CONNECTED, 5.0, restart_every=3.5),
    "silent": _row(CONNECTED, 10.0, silent_after=5.0),
    "hash": _row(wrong_hashes=("VehicleStatus",)),
    "version": _row(versions={"VehicleStatus": 9}),
    "clock": _row(clock_off=-7.0),
    "unsettled": _row(clock_off=-0.04),
    "boot": Row((CALM._replace(sync="off"),)),
    "twin": _row(CONNECTED, 0.0, CALM._replace(key=7), CALM._replace(key=7, namespace="b")),
    "same namespace": _row(CONNECTED, 0.0, CALM._replace(key=7), CALM._replace(key=8)),
    "healthy": Row((CALM,)),
}


@pytest.fixture(scope="module")
def expected(px4_types: Any) -> Expected:
    found = expected_of(px4_types, "px4_types", is_given=True)
    return found._replace(topics=tuple(topic._replace(interval=0.2) for topic in found.topics))


@contextmanager
def doctor(link: SimulatedLink, monkeypatch: pytest.MonkeyPatch, *, is_shared: bool) -> Iterator[None]:
    """Let the doctor open a link, or join its owner."""
    link.use(monkeypatch)
    if not is_shared:
        monkeypatch.setattr("msggen.doctor.watching.open_link", lambda *_, **_others: link)
        yield
        return
    with TemporaryDirectory(prefix="run-") as folder:
        path = Path(folder) / "x.socket"
        far = UnixLink(str(path))
        monkeypatch.setattr("msggen.doctor.watching.open_link", lambda *_, **_others: far)
        link.after_sleep = lambda: settle(far)
        with nothing_is_left(), served(cast("Any", link), path, str(ADDRESS)):
            try:
                yield
            finally:
                far.close()


def settle(link: UnixLink) -> None:
    """Wait until a program and the owner have taken all that they were told. An answer comes after what was before it.

    The second question comes after what the program asks for when it hears of a vehicle.
    """
    for _ in range(2):
        while link.ask("state") is None:
            pass


def plans(row: Row) -> list[tuple[float, float]]:
    """Return the waits and watches that show a fault: all watches for a vehicle that connects, which ends the wait."""
    if row.wait:
        return [(wait, seconds) for wait in (row.wait, 30.0) for seconds in SECONDS if seconds >= row.watch]
    return [*zip(WAITS, cycle(SECONDS))]


def some(found: list[tuple[float, float]], *, is_shared: bool) -> list[tuple[float, float]]:
    """Return those of the day: every eighth one, others at the link than through its owner."""
    return found[len(found) // 2 * is_shared :: 8]


not_on_windows = pytest.mark.skipif(not CAN_SHARE, reason="links are not shared on Windows")


@pytest.fixture
def finds(px4_types: Any, expected: Expected, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """What looks at vehicles for some time and returns what it finds."""

    def find(row: Row, wait: float, seconds: float, *, is_shared: bool) -> list[str]:
        link = SimulatedLink(px4_types, row.vehicles)
        with doctor(link, monkeypatch, is_shared=is_shared):
            seen = decoded(observe(ADDRESS, Plan(seconds, wait)), lambda _: [px4_types])
        return ids(judged(seen, expected))

    return find


@pytest.mark.slow  # minutes of simulated time
@pytest.mark.parametrize(
    ("name", "is_shared", "extent"),
    [
        *((name, False, "some") for name in ROWS),
        *(pytest.param(name, True, "some", marks=not_on_windows) for name in [*ROWS][::3]),
        *(pytest.param(name, False, "all", marks=pytest.mark.night) for name in ROWS),
        *(pytest.param(name, True, "all", marks=[pytest.mark.night, not_on_windows]) for name in ROWS),
    ],
)
def test_a_fault_is_found_with_each_wait(
    name: str, *, is_shared: bool, extent: str, finds: Callable[..., list[str]]
) -> None:
    every = plans(ROWS[name])
    wanted = every if extent == "all" else some(every, is_shared=is_shared)
    found = {plan: finds(ROWS[name], *plan, is_shared=is_shared) for plan in wanted}
    assert found == dict.fromkeys(wanted, rules_of(name) if name != "healthy" else [])
