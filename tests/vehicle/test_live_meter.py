"""Tests of the meter of topics, against a slow computation of the same."""

from __future__ import annotations

import math
import statistics

from hypothesis import given
from hypothesis import strategies as st

from msggen.link.link import Route
from msggen.vehicle.meter import Meter

ROUTE = Route("/fmu/out/vehicle_status_v1", "px4_msgs/msg/VehicleStatus", "out", 1)
SECOND = 1_000_000_000

arrivals = st.lists(st.integers(1, 8 * SECOND), min_size=1, max_size=40, unique=True).map(sorted)


@given(arrivals, st.integers(0, 8 * SECOND), st.data())
def test_rates_are_those_of_the_window(times: list[int], later: int, data: st.DataObject) -> None:
    sizes = data.draw(st.lists(st.integers(4, 1000), min_size=len(times), max_size=len(times)))
    meter, now = Meter(window=2.0), times[-1] + later
    for time, size in zip(times, sizes, strict=True):
        meter(ROUTE, bytes(size), time)
    (flow,) = meter.flows(now)
    assert (flow.route, flow.samples, flow.size, flow.total) == (ROUTE, len(times), sizes[-1], sum(sizes))
    assert (flow.first, flow.last, flow.payload) == (times[0], times[-1], bytes(sizes[-1]))
    recent = [(time / SECOND, size) for time, size in zip(times, sizes, strict=True) if now - time <= 2 * SECOND]
    if len(recent) < 2:
        assert math.isnan(flow.rate)
        assert math.isnan(flow.bandwidth)
        return
    span = recent[-1][0] - recent[0][0]
    gaps = [recent[index + 1][0] - recent[index][0] for index in range(len(recent) - 1)]
    assert math.isclose(flow.rate, (len(recent) - 1) / span, rel_tol=1e-6)
    assert math.isclose(flow.bandwidth, sum(size for _, size in recent[1:]) / span, rel_tol=1e-6)
    assert math.isclose(flow.shortest, min(gaps), rel_tol=1e-6, abs_tol=1e-9)
    assert math.isclose(flow.longest, max(gaps), rel_tol=1e-6)
    assert math.isclose(flow.deviation, statistics.pstdev(gaps), rel_tol=1e-6, abs_tol=1e-8)


def test_topics_come_in_the_order_of_their_first_samples() -> None:
    meter = Meter()
    names = ["/fmu/out/b", "/fmu/out/a", "/fmu/out/b"]
    for time, name in enumerate(names):
        meter(ROUTE._replace(name=name), b"\0\1\0\0", time)
    assert [flow.route.name for flow in meter.flows(3)] == ["/fmu/out/b", "/fmu/out/a"]


def test_a_topic_is_seen_with_its_first_sample_or_not_at_all() -> None:
    """Another thread may look at any time: here at each use of the lock."""
    meter, seen = Meter(), []

    class Lock:
        is_free = True

        def __enter__(self) -> None:
            pass

        def __exit__(self, *_: object) -> None:
            if self.is_free:
                self.is_free = False
                seen.extend(meter.flows(SECOND))
                self.is_free = True

    meter._lock = Lock()  # type: ignore[assignment]
    meter(ROUTE, b"\0\1\0\0", SECOND)
    assert [(flow.samples, flow.last) for flow in seen] == [(1, SECOND)]


def test_a_clock_that_is_set_back_begins_another_window() -> None:
    meter = Meter(window=2.0)
    for time in (100 * SECOND, 101 * SECOND, 50 * SECOND, 51 * SECOND):
        meter(ROUTE, b"\0\1\0\0", time)
    (flow,) = meter.flows(51 * SECOND)
    assert (flow.rate, flow.window, flow.samples) == (1.0, 2, 4)
