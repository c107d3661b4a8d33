"""Tests of TimeSync with recorded exchanges, and with the same exchanges shifted, stretched or delayed.

`timesync.csv` has exchanges over UDP between two processes of a loaded computer, five per second. The vehicle answered
with its time since boot, and the companion measured with the operating system's clock. Both clocks are of one computer,
so the offset was read directly at the start and at the end: it is in the last line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from support.repository import VECTORS

TEXT = (VECTORS / "timesync.csv").read_text()
TRUTH = tuple(int(number) for number in re.findall(r"-\d+", TEXT.splitlines()[-1]))
SECOND = 1_000_000


class Exchange(NamedTuple):
    """The time when the companion sent it, of the vehicle's answer, and when the companion received that, in us."""

    sent: int
    answered: int
    received: int

    @property
    def offset(self) -> float:
        return self.answered - (self.sent + self.received) / 2

    def status(self, px4_types: Any, estimated: float) -> Any:
        """Return what the firmware publishes about the exchange."""
        return px4_types.TimesyncStatus(
            source_protocol=px4_types.TimesyncStatus.SOURCE_PROTOCOL_DDS,
            remote_timestamp=self.received,
            observed_offset=round(self.offset),
            estimated_offset=round(estimated),
            round_trip_time=self.received - self.sent,
        )


RECORDED = [Exchange(*map(int, line.split(","))) for line in TEXT.splitlines()[1:-1]]


@pytest.fixture(scope="module")
def clock(px4_types: Any) -> Any:
    return px4_types.clock


def synchronised(clock: Any, exchanges: Iterable[Exchange], **options: int) -> Any:
    sync = clock.TimeSync(**options)
    for exchange in exchanges:
        sync.add(*exchange)
    return sync


def moved(exchanges: Iterable[Exchange], by: int) -> list[Exchange]:
    """Return exchanges with a vehicle's clock that is ahead."""
    return [each._replace(answered=each.answered + by) for each in exchanges]


def delayed(exchange: Exchange, by: int) -> Exchange:
    """Return an exchange whose answer was slow, so that the offset looks too small."""
    return exchange._replace(received=exchange.received + by)


def test_the_recording_is_long_and_has_slow_exchanges() -> None:
    trips = sorted(exchange.received - exchange.sent for exchange in RECORDED)
    assert len(RECORDED) > 200
    assert trips[-1] > 5 * trips[0]


def test_the_offset_is_that_of_the_clocks(clock: Any) -> None:
    sync = clock.TimeSync()
    for exchange in RECORDED:
        sync.add(*exchange)
        if sync.is_converged:
            assert abs(sync.offset - TRUTH[0]) <= sync.error + abs(TRUTH[1] - TRUTH[0])
    assert sync.is_converged
    assert abs(sync.offset - TRUTH[1]) < 500
    assert abs(sync.drift) < 2e-5
    assert sync.round_trip == pytest.approx(sorted(each.received - each.sent for each in RECORDED[-100:])[50])
    assert (sync.jumps, sync.problem) == (0, "")


def test_the_estimate_is_better_than_single_exchanges(clock: Any) -> None:
    mean = sum(abs(each.offset - TRUTH[1]) for each in RECORDED) / len(RECORDED)
    worst = max(abs(each.offset - TRUTH[1]) for each in RECORDED)
    estimate = abs(synchronised(clock, RECORDED).offset - TRUTH[1])
    assert estimate < worst / 4
    assert estimate < 2 * mean


@pytest.mark.parametrize("count", [0, 1, 9])
def test_too_few_samples_have_not_converged(clock: Any, count: int) -> None:
    sync = synchronised(clock, RECORDED[:count])
    assert not sync.is_converged
    assert sync.problem == f"there are {count} of 10 samples"
    uses: list[Callable[[], Any]] = [lambda: sync.offset, lambda: sync.to_vehicle(1), lambda: sync.to_companion(1)]
    for use in uses:
        with pytest.raises(clock.NotConverged, match=f"^there are {count} of 10 samples$"):
            use()
    assert math.isnan(sync.error) == (count == 0)
    assert math.isnan(sync.round_trip) == (count == 0)


def test_an_error_above_the_limit_has_not_converged(clock: Any) -> None:
    slow = [delayed(each, 30_000) for each in RECORDED[:20]]
    sync = synchronised(clock, slow)
    assert re.fullmatch(r"the offset can be wrong by 1[5-9]\d\d\d us, more than 5000", sync.problem)
    assert synchronised(clock, slow, max_error=30_000).is_converged


def test_times_of_both_clocks(clock: Any) -> None:
    sync = synchronised(clock, RECORDED)
    for exchange in RECORDED[-50:]:
        middle = (exchange.sent + exchange.received) // 2
        allowed = sync.error + (exchange.received - exchange.sent) / 2 + 1
        assert abs(sync.to_vehicle(middle) - exchange.answered) <= allowed
        assert abs(sync.to_companion(sync.to_vehicle(middle)) - middle) <= 1


def test_a_time_of_the_wrong_clock_is_an_error(clock: Any) -> None:
    """Of the recorded clocks, only the companion's counts from 1970."""
    sync = synchronised(clock, RECORDED)
    calendar, boot = RECORDED[-1].sent, RECORDED[-1].answered
    assert boot < clock.CALENDAR < calendar
    text = (
        f"^{calendar} us counts from 1970, and the vehicle's clock from boot, or the start of a simulator: the bridge"
    )
    with pytest.raises(clock.ClockError, match=text):
        sync.to_companion(calendar)
    text = f"^{boot} us counts from boot, or the start of a simulator, and the companion's clock from 1970: to_comp"
    with pytest.raises(clock.ClockError, match=text):
        sync.to_vehicle(boot)


def test_what_is_no_time_is_an_error(px4_types: Any, clock: Any) -> None:
    sync = synchronised(clock, RECORDED)
    message = px4_types.TimesyncStatus()
    uses: list[Callable[[Any], Any]] = [sync.to_companion, sync.to_vehicle, lambda value: sync.add(value, 1, 2)]
    for use in uses:
        for value in ("a", 1.5, message):
            kind = value.__class__.__name__
            with pytest.raises(
                clock.ClockError, match=f"^expected microseconds as an int, got an object of type {kind}$"
            ):
                use(value)


@pytest.mark.parametrize("drift", [1e-4, -5e-5])
def test_a_drift_is_measured(clock: Any, drift: float) -> None:
    start = RECORDED[0].sent
    drifting = [each._replace(answered=each.answered + round((each.sent - start) * drift)) for each in RECORDED]
    sync = synchronised(clock, drifting)
    assert sync.drift == pytest.approx(drift, abs=2e-5)
    expected = TRUTH[1] + (RECORDED[-1].sent - start) * drift
    assert abs(sync.offset - expected) < 1000
    later = RECORDED[-1].sent + 10 * SECOND
    assert abs(sync.to_vehicle(later) - later - expected - 10 * SECOND * drift) < 1000


def test_outliers_are_not_used(clock: Any) -> None:
    """An outlier is farther away than its round trip allows: the answer has a wrong time."""
    expected = synchronised(clock, [each for n, each in enumerate(RECORDED) if n < 50 or n % 7])
    wrong = [each if n < 50 or n % 7 else moved([each], 80_000)[0] for n, each in enumerate(RECORDED)]
    sync = synchronised(clock, wrong)
    assert sync.outliers == len([n for n in range(50, len(RECORDED)) if n % 7 == 0])
    assert sync.offset == expected.offset
    assert sync.jumps == 0


def test_slow_exchanges_do_not_move_the_offset(clock: Any) -> None:
    """The answer of every third exchange comes 200 ms late, which is no outlier: its round trip tells it."""
    slow = [each if n % 3 else delayed(each, 200_000) for n, each in enumerate(RECORDED)]
    sync = synchronised(clock, sorted(slow, key=lambda each: each.received))
    assert sync.is_converged
    assert abs(sync.offset - TRUTH[1]) < 1000


@pytest.mark.parametrize("by", [3 * SECOND, -3 * SECOND])
def test_a_jump_of_the_vehicles_clock(clock: Any, by: int) -> None:
    """As after a reboot. Four samples are outliers, the fifth is the jump, and five more are needed."""
    sync = synchronised(clock, RECORDED[:100])
    states = []
    for exchange in moved(RECORDED[100:120], by):
        sync.add(*exchange)
        states.append((sync.jumps, sync.outliers, sync.is_converged))
    assert states[3] == (0, 4, True)
    assert states[4] == (1, 0, False)
    assert states[9:] == [(1, 0, True)] * 11
    assert abs(sync.offset - TRUTH[0] - by) < 1000


def test_a_jump_is_the_problem_until_it_is_over(clock: Any) -> None:
    sync = synchronised(clock, [*RECORDED[:100], *moved(RECORDED[100:106], 3 * SECOND)])
    assert re.fullmatch(r"a clock jumped by (3|2.99\d*|3.00\d*) s, and there are 6 of 10 samples", sync.problem)
    with pytest.raises(clock.NotConverged, match=r"^a clock jumped by"):
        sync.to_companion(1)


def test_a_companions_clock_that_goes_back_is_a_jump(clock: Any) -> None:
    sync = synchronised(clock, RECORDED[:100])
    back = [
        Exchange(each.sent - 3600 * SECOND, each.answered, each.received - 3600 * SECOND) for each in RECORDED[100:]
    ]
    sync.add(*back[0])
    assert sync.jumps == 1
    assert sync.problem.startswith("a clock jumped by -3599.")
    for exchange in back[1:]:
        sync.add(*exchange)
    assert sync.is_converged
    assert abs(sync.offset - TRUTH[1] - 3600 * SECOND) < 1000


def test_a_received_answer_was_sent_before(clock: Any) -> None:
    with pytest.raises(clock.ClockError, match=r"^the exchange was received 1 us before it was sent$"):
        clock.TimeSync().add(10, 5, 9)


# --- timesync_status


def test_another_message_is_not_followed(px4_types: Any, clock: Any) -> None:
    with pytest.raises(TypeError, match="expected a TimesyncStatus, got VehicleAttitude"):
        clock.TimeSync().follow(px4_types.VehicleAttitude())


def test_timesync_status_is_followed(px4_types: Any, clock: Any) -> None:
    """The firmware's estimate is 40 ms off, as it can be for minutes after the start."""
    sync = clock.TimeSync()
    for exchange in RECORDED:
        sync.follow(exchange.status(px4_types, TRUTH[0] - 40_000))
    assert sync.is_converged
    assert abs(sync.offset - TRUTH[1]) < 1000
    assert sync.bridge_error == pytest.approx(40_000, abs=1000)


def test_a_window_that_cannot_converge_is_an_error(clock: Any) -> None:
    for window in (9, 0, -1):
        with pytest.raises(clock.ClockError, match=f"^expected a window of 10 samples or more, got {window}$"):
            clock.TimeSync(window=window)


def test_other_sources_and_empty_messages_are_ignored(px4_types: Any, clock: Any) -> None:
    cls, sync = px4_types.TimesyncStatus, clock.TimeSync()
    for exchange in RECORDED:
        status = exchange.status(px4_types, 0)
        status.source_protocol = cls.SOURCE_PROTOCOL_MAVLINK
        sync.follow(status)
    sync.follow(cls(source_protocol=cls.SOURCE_PROTOCOL_DDS))
    ignored = f"; messages of another source_protocol were ignored: {len(RECORDED)}"
    assert sync.problem == f"there are 0 of 10 samples{ignored}"
    assert math.isnan(sync.bridge_error)
    sync.follow(status, source=cls.SOURCE_PROTOCOL_MAVLINK)
    assert sync.problem == f"there are 1 of 10 samples{ignored}"


def test_the_source_is_that_of_the_definition(px4_types: Any) -> None:
    assert px4_types.timesync._DDS == px4_types.TimesyncStatus.SOURCE_PROTOCOL_DDS


# --- The clock of a simulator


def test_a_simulation_of_another_speed_does_not_converge_with_the_systems_clock(clock: Any) -> None:
    """The vehicle's clock runs at half the speed, so the offset changes by half a second in each second."""
    start = RECORDED[0].sent
    sync = clock.TimeSync()
    for each in RECORDED:
        sync.add(each.sent, each.answered - (each.sent - start) // 2, each.received)
        assert not sync.is_converged
    text = "the vehicle's clock runs at 0.5 times the speed of the companion's: use the simulator's /clock"
    assert sync.problem == text


def test_a_simulation_of_another_speed_converges_with_its_own_clock(clock: Any) -> None:
    """All times of the exchanges are the simulator's, in steps of 4 ms, so most round trips are 0."""
    simulator, sync = clock.SimulatorClock(), clock.TimeSync()
    start = RECORDED[0].sent

    def simulated(moment: int) -> int:
        simulator.update(clock.to_ros((moment - start) // 2 // 4000 * 4000))
        return int(simulator.now())

    for each in RECORDED:
        sync.add(simulated(each.sent), simulated(each.sent + 50), simulated(each.received))
    assert sync.is_converged
    assert abs(sync.offset) <= 4000
    simulator.update(SimpleNamespace(sec=0, nanosec=0))
    sync.add(simulator.now(), simulator.now(), simulator.now())
    assert (simulator.resets, sync.jumps) == (1, 1)
