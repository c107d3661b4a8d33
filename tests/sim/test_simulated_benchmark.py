"""Tests of benchmarks/simulated.py: vehicles and a program fly, and their speed is measured."""

from __future__ import annotations

import pytest

pytest.importorskip("cyclonedds")

import simulated


def test_a_flight_without_an_agent_is_measured() -> None:
    assert simulated.alone(3.0) > 0


def test_a_program_flies_its_mode_in_the_same_process() -> None:
    ratio, height = simulated.one_process(20.0)
    assert ratio > 0
    assert height == pytest.approx(10.0, abs=1.0)  # that of its setpoints


@pytest.mark.night
def test_a_vehicle_behind_a_socket_is_measured() -> None:
    speed, rate = simulated.sockets(4.0, 1.0)
    assert 0 < speed < 4.4
    assert rate > 100
