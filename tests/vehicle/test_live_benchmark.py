"""Tests of benchmarks/link.py, shared_link.py and network.py: what is sent arrives and is shown, over each link."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pytest

pytest.importorskip("cyclonedds")

import link
import network
import shared_link
from link_sender import Load
from support.examples import by_day


@by_day(
    ("measure", "load"),
    [
        (link.measure_udp, Load("udp", 0, 3, 4, 600, 0.2)),
        (link.measure_dds, Load("dds", link.DOMAIN, 1, 2, 200, 0.2)),
        (link.measure_typed, Load("typed", link.DOMAIN, 1, 1, 200, 0.2)),
    ],
    3,
)
def test_samples_are_sent_and_measured(measure: Callable[[Load], link.Result], load: Load) -> None:
    result = measure(load)
    assert result.sent == load.rate * load.seconds
    assert 0 < result.received <= result.sent
    assert len(result.latencies) == result.received
    assert result.latencies[0] > 0
    assert result.cpu > 0


def test_what_is_published_arrives_at_the_vehicle_and_is_measured() -> None:
    result = link.measure_to_vehicle(600, 0.2)
    assert result.sent == 120
    assert 0 < result.received <= result.sent
    assert result.latencies[0] > 0


def test_a_row_shows_loss_latency_and_cpu_time() -> None:
    result = link.Result(200, 100, list(range(1000, 101_000, 1000)), 0.002)
    assert result.row("name") == ["name", "200", "50 %", "51", "100", "20"]
    assert result._replace(sent=100).row("name")[2] == "0"
    assert link.Result(200, 0, [], 0.0).row("name") == ["name", "200", "100 %", "", "", ""]
    assert len(link.HEAD) == len(result.row("name"))


@pytest.mark.night
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the time of a process")
def test_programs_share_a_link_and_are_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MSGGEN_DIRECT")
    row = shared_link.measure("one", "shared", 2, 1, 100, 1.0)
    assert row[:2] == ["one", "2"]
    assert len(row) == len(shared_link.HEAD)
    assert float(row[6].replace(",", "")) > 0


@pytest.mark.night
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the time of a process")
@pytest.mark.parametrize("way", network.WAYS, ids=lambda way: way.name)
def test_a_vehicle_is_measured_on_each_way(way: network.Way, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("zenoh")
    monkeypatch.delenv("MSGGEN_DIRECT")
    name, *row = network.measure_way(way, 2, 50, 1.0)
    assert name == way.name
    assert len(row) == len(network.WAYS_HEAD) - 1
    assert float(row[3].replace(",", "")) > 0
    assert float(network.measure_first(way)[1]) > 0


@pytest.mark.night
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the time of a process")
def test_vehicles_behind_three_routers_are_measured() -> None:
    pytest.importorskip("zenoh")
    row = network.measure_size(3, 2, 10, 1.0)
    assert row[:2] == ["3", "60"]
    assert len(row) == len(network.SIZES_HEAD)
