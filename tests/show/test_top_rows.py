"""Tests of the rows of `msggen top`: what is measured, expected and late."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from types import ModuleType

from msggen.link.link import Route
from msggen.show.report.json import dump
from msggen.show.top.drawing import plain
from msggen.show.top.rows import SECONDS, Health, History, Table, as_document, health_of, limits_of, rows_of, sparkline
from msggen.vehicle.meter import Meter

SECOND = 1_000_000_000
STATUS = Route("/uav_1/fmu/out/vehicle_status_v4", "px4_msgs/msg/VehicleStatus", "out", 1)
ACK = Route("/uav_1/fmu/out/vehicle_command_ack_v1", "px4_msgs/msg/VehicleCommandAck", "out", 2)
SETPOINT = Route("/uav_1/fmu/in/trajectory_setpoint", "px4_msgs/msg/TrajectorySetpoint", "in", 3)
UNKNOWN = Route("/uav_1/fmu/out/mine", "px4_msgs/msg/Mine", "out", 4)


def heard(route: Route, *times: float) -> Meter:
    """Return a meter that has heard samples of 24 bytes at some times in s."""
    meter = Meter()
    for time in times:
        meter(route, bytes(24), round(time * SECOND))
    return meter


def test_a_row_has_what_was_measured_and_the_limit(px4_types: ModuleType) -> None:
    meter = heard(STATUS, *(each / 4 for each in range(1, 21)))
    rows = rows_of([STATUS, ACK, SETPOINT], meter.flows(5 * SECOND), limits_of(px4_types), "uav_1", round(5.1 * SECOND))
    ack, status = rows
    assert (status.topic, status.message, status.limit) == (STATUS.name, "VehicleStatus", 5.0)
    assert (status.samples, status.size, status.state) == (20, 24, "")
    assert math.isclose(status.rate, 4.0)
    assert math.isclose(status.bandwidth, 96.0)
    assert math.isclose(status.age, 0.1)
    assert math.isclose(status.longest, 0.25)
    assert (ack.topic, ack.samples, ack.state) == (ACK.name, 0, "silent")
    assert all(math.isnan(number) for number in (ack.rate, ack.limit, ack.age, ack.bandwidth, ack.size, ack.longest))


def test_a_topic_that_stops_is_late() -> None:
    meter = heard(STATUS, *(each / 10 for each in range(50)))
    states = {}
    for now in (5.0, 6.0, 7.5, 60.0):
        (row,) = rows_of([STATUS], meter.flows(round(now * SECOND)), {}, "uav_1", round(now * SECOND))
        states[now] = row.state, math.isnan(row.rate)
    assert states == {5.0: ("", False), 6.0: ("", True), 7.5: ("late", True), 60.0: ("late", True)}


def test_answers_are_never_late() -> None:
    """A topic without a usual interval: few samples, or one burst."""
    for times in ((1.0, 2.0, 3.0), [1.0 + each / 1000 for each in range(60)]):
        meter = heard(ACK, *times)
        (row,) = rows_of([ACK], meter.flows(600 * SECOND), {}, "uav_1", 600 * SECOND)
        assert row.state == ""


def test_a_slow_topic_is_not_late_between_two_samples() -> None:
    meter = heard(STATUS, *range(0, 100, 10))
    for now, state in ((100, ""), (139, ""), (141, "late")):
        (row,) = rows_of([STATUS], meter.flows(now * SECOND), {}, "uav_1", now * SECOND)
        assert row.state == state


def test_a_topic_that_is_heard_has_a_row_without_a_route() -> None:
    rows = rows_of([STATUS], heard(UNKNOWN, 1.0).flows(SECOND), {}, "uav_1", SECOND)
    assert [row.topic for row in rows] == [UNKNOWN.name, STATUS.name]


def test_the_summary_counts_all_topics() -> None:
    meter = heard(STATUS, 1.0, 1.5, 2.0)
    rows = rows_of([STATUS, ACK], meter.flows(2 * SECOND), {}, "uav_1", 2 * SECOND)
    assert Table(rows, "", lost=3).summary == "2 topics, 1 heard, 2 samples/s, 0.0 kB/s, 3 lost"


def test_a_meter_keeps_the_samples_of_its_window_only() -> None:
    meter = heard(STATUS, *(each / 100 for each in range(3000)))
    assert len(meter._topics[STATUS.name].samples) == 501


def test_the_document_and_the_plain_table_have_the_same_topics() -> None:
    meter = heard(STATUS, 1.0, 1.5, 2.0)
    table = Table(rows_of([STATUS, ACK], meter.flows(2 * SECOND), {}, "uav_1", 2 * SECOND), "v1.18")
    document = json.loads(dump(as_document(table)))
    heading, *lines = plain(table)
    assert heading.split() == ["topic", "Hz", "limit", "age", "s", "kB/s", "bytes", "samples", "longest", "s"]
    assert [line.split()[0] for line in lines] == [each["topic"] for each in document["topics"]]
    assert lines[0].split()[1:] == ["-", "-", "-", "-", "-", "0", "-", "silent"]
    assert document["topics"][0]["rate_hz"] is None
    assert (document["topics"][1]["rate_hz"], document["topics"][1]["age_s"]) == (2.0, 0.0)


# --- the rates of the last seconds


def history_of(meter: Meter, times: Sequence[float]) -> tuple[float, ...]:
    """Return the rates of the one topic of a meter that is looked at at some times in s."""
    history = History()
    for time in times:
        now = round(time * SECOND)
        kept = Meter(1e6)
        for arrival, size in meter._topics[STATUS.name].samples:
            if arrival <= now:
                kept(STATUS, bytes(size), arrival)
        (row,) = history.add(rows_of([STATUS], kept.flows(now), {}, "uav_1", now), now)
    return tuple(row.rates)


def test_each_whole_second_has_a_rate() -> None:
    meter = Meter(1e6)
    for time in [*(each / 10 for each in range(100, 150)), *(each / 5 for each in range(80, 90))]:
        meter(STATUS, bytes(24), round((time + 0.05) * SECOND))
    rates = history_of(meter, [10 + each / 2 for each in range(17)])
    assert [round(rate) for rate in rates] == [10, 10, 10, 10, 0, 5, 5]
    assert sparkline(rates) == "▇▇▇▇▁▄▄"


def test_the_rates_go_on_after_a_pause_and_when_the_clock_is_set_back() -> None:
    meter = Meter(1e6)
    for number in range(1000):
        meter(STATUS, bytes(24), number * SECOND // 10)
    rates = history_of(meter, [1.0, 1.5, 2.0, 95.25, 95.75, 96.0])
    assert len(rates) == SECONDS
    assert all(9 < rate < 11 for rate in rates)
    history, (row,) = History(), rows_of([STATUS], meter.flows(SECOND), {}, "uav_1", SECOND)
    for time, samples in ((50, 100), (51, 110), (40, 120), (41, 130), (42, 140)):
        (row,) = history.add([row._replace(samples=samples)], time * SECOND)
    assert [*row.rates] == [20.0, 10.0]


def test_a_topic_without_samples_has_no_line() -> None:
    history = History()
    for now in (SECOND, 3 * SECOND):
        (row,) = history.add(rows_of([ACK], [], {}, "uav_1", now), now)
    assert sparkline(row.rates) == ""
    assert sparkline((0.0, 50.0, 100.0)) == "▁▄▇"


# --- the state of the vehicle


def test_messages_tell_the_state(px4_types: ModuleType) -> None:
    status = px4_types.VehicleStatus(nav_state=5, arming_state=2, failsafe=True)
    battery = px4_types.BatteryStatus(remaining=0.5, warning=1)
    assert health_of(status, battery) == Health("AUTO_RTL", "ARMED", True, 0.5, "LOW")  # noqa: FBT003
    assert health_of(px4_types.VehicleStatus(nav_state=200), None)[0] == "unknown"


def test_what_no_message_tells_is_not_known(px4_types: ModuleType) -> None:
    for battery in (None, px4_types.BatteryStatus(remaining=-1.0), px4_types.BatteryStatus(remaining=math.nan)):
        health = health_of(None, battery)
        assert (health[:3], math.isnan(health.battery), health.warning) == (("", "", False), True, "")
    document = json.loads(dump(as_document(Table((), "", health=health_of(None, None)))))
    assert (document["mode"], document["arming"], document["battery"]) == (None, None, None)
