"""Tests of benchmarks/setpoints.py: setpoints and answers of a simulated vehicle are found and measured."""

from __future__ import annotations

import re
import sys

import pytest

import setpoints

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for the times of datagrams")
pytest_plugins = ["support.owned_links"]


@pytest.mark.night  # it measures for seconds
@pytest.mark.usefixtures("owned")
@pytest.mark.parametrize("way", setpoints.WAYS)
def test_setpoints_are_measured_at_each_rate(way: str) -> None:
    found = [*setpoints.steadiness(way, setpoints.ALONE, [(50.0, 0.3), (100.0, 0.3)])]
    assert len(found) == 2
    assert all(re.fullmatch(r"\d+\.\d / \d+\.\d / \d+\.\d", each) for each in found)


@pytest.mark.slow
def test_answers_are_measured() -> None:
    rows = [*setpoints.answers("direct", 2)]
    assert [name for name, *_ in rows] == ["request to registered, direct", "command to acknowledged, direct"]
    assert all(0.0 < float(median) <= float(worst) for _, median, worst in rows)


def test_jitter_is_the_difference_from_the_interval_of_the_rate() -> None:
    times = [0, 10_000_000, 21_000_000, 30_500_000]
    assert setpoints.jitter(times, 100.0) == "0.5 / 1.0 / 1.0"
