"""Tests of the doctor with vehicles on Zenoh."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from msggen.doctor.expected import Expected, expected_of
from msggen.doctor.observation import Observation
from msggen.doctor.watching import Plan, observe
from msggen.link.address import parse_address
from msggen.live import Vehicle
from msggen.sim import Options, Simulator
from support.faults import rules_of
from support.findings import ids, judged, texts
from support.ports import free_port
from support.zenoh_space import session

pytest.importorskip("zenoh")
pytest_plugins = ["support.owned_links"]
CALM = Options(sync="off", rate=10.0)
QUICK = Plan(seconds=1.0, wait=5.0, is_direct=True)


@pytest.fixture
def url() -> str:
    return f"zenoh://127.0.0.1:{free_port()}"


@pytest.fixture(scope="module")
def own(px4_types: Any) -> Expected:
    found = expected_of(px4_types, "px4_types", is_given=False)
    return found._replace(topics=tuple(topic._replace(interval=0.1) for topic in found.topics))


def seen(url: str, plan: Plan = QUICK) -> Observation:
    return observe(parse_address(url), plan)


@contextmanager
def repeated(act: Callable[[], object]) -> Iterator[None]:
    """Do something in a thread, again and again."""
    over = threading.Event()

    def run() -> None:
        while not over.wait(0.05):
            act()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_nothing_is_wrong_with_a_vehicle_on_zenoh(url: str, own: Expected, px4_types: Any) -> None:
    with Simulator(px4_types, url, [CALM]):
        assert ids(judged(seen(url), own)) == []


def test_a_topic_that_zenoh_does_not_have_is_named(url: str, own: Expected, px4_types: Any) -> None:
    with Simulator(px4_types, url, [CALM]):
        found = judged(seen(url), own, "home_position")
    assert ids(found) == ["TOPIC_NOT_BRIDGED"]
    assert "add it to zenoh/pub.csv" in texts(found)


def test_no_vehicle_may_be_one_of_v1_15(url: str, own: Expected) -> None:
    found = judged(seen(url, QUICK._replace(wait=0.5)), own)
    assert ids(found) == ["NO_CLIENT"]
    assert "a router drops v1.15 without a word (protocol 0x07)" in texts(found)
    assert f"`msggen sim --zenoh tcp/127.0.0.1:{url.rpartition(':')[2]}` simulates one" in texts(found)


def test_a_vehicle_of_v1_16_is_refused_with_the_reason(url: str, own: Expected) -> None:
    port = int(url.rpartition(":")[2])
    with session(port, "router") as router, repeated(lambda: router.put("fmu/out/vehicle_status", b"\0\1\0\0")):
        found = judged(seen(url, QUICK._replace(wait=4.0)), own)
    assert ids(found) == rules_of("old on Zenoh")


@pytest.mark.usefixtures("owned")
def test_answers_to_checks_may_be_too_large(url: str, own: Expected, px4_types: Any) -> None:
    with Simulator(px4_types, url, [CALM]), Vehicle(url, px4_types) as vehicle:
        vehicle.wait_connected(20.0)
        with repeated(lambda: vehicle.publish(px4_types.ArmingCheckReply())):
            found = judged(seen(url, QUICK._replace(is_direct=False)), own)
    assert rules_of("checks on Zenoh")[0] in ids(found)
