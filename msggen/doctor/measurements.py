"""What programs send to the estimator of a vehicle: whether EKF2 can use it, and whether it does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from statistics import median

from msggen.check.finding import Change
from msggen.doctor.case import Case
from msggen.doctor.observation import VehicleSeen
from msggen.doctor.setpoints import Sent, Values, sent
from msggen.messages.measurements import (
    GLOBAL,
    LOCAL,
    NEAREST,
    OLDEST,
    PLACE,
    SLOWEST,
    UNREAD,
    dropped,
    reason,
    taken,
)

_FUTURE = 0.05
"""How far in s the time of a measurement is ahead of its arrival, to be reported: clocks differ a little."""
_FIRST_UTC = 1e15
"""Times in us below are times since boot, which PX4 takes for the time of arrival while clocks are synchronized."""
_SEEN = 1.5
"""The time in s for which measurements must have been seen: EKF2 begins within 1 s."""


def measured(case: Case, vehicle: VehicleSeen) -> Iterator[tuple[str, Sent]]:
    """Yield the measurements that programs send to a vehicle, with the names of their uORB topics."""
    found = sent(case, vehicle)
    yield from ((name, found[name]) for name in (LOCAL, GLOBAL) if name in found)


def find_dropped(case: Case) -> Iterator[Change]:
    """Find measurements that EKF2 drops because of their values."""
    for vehicle in case.alive:
        unread = sent(case, vehicle).get(UNREAD)
        if unread is not None:
            yield case.change(
                unread.route.name,
                f"'{unread.route.name}' from {unread.senders} is not read by EKF2: publish the same on {LOCAL}",
            )
        for name, each in measured(case, vehicle):
            for problem in _dropped(name, each.values):
                yield case.change(each.route.name, f"'{each.route.name}' from {each.senders} {problem}")


def _dropped(name: str, values: Values) -> Iterator[str]:
    if name == LOCAL:
        yield from dropped(values) if values else ()
    elif not all(math.isfinite(values.get(field, 0.0)) for field in ("lat", "lon")):
        yield "has no finite `lat` and `lon`, and EKF2 drops it: set both in degrees"


def find_wrong_times(case: Case) -> Iterator[Change]:
    """Find measurements that EKF2 does not use because of their times."""
    for vehicle in case.alive if case.seen.hears_programs else ():
        for _, each in measured(case, vehicle):
            problem = _wrong_time(case, vehicle, each)
            if problem:
                yield case.change(each.route.name, f"'{each.route.name}' from {each.senders} {problem}")


def _wrong_time(case: Case, vehicle: VehicleSeen, each: Sent) -> str:
    stamps = [(sample.time / 1e3, sample.values.get("timestamp_sample", 0)) for sample in each.seen.last]
    known = [(arrival, stamp) for arrival, stamp in stamps if stamp >= _FIRST_UTC]
    if not known:
        return ""
    age = median(arrival - stamp for arrival, stamp in known) / 1e6
    if case.has_utc(vehicle) and age > OLDEST:
        return (
            f"is {age:.2f} s old by `timestamp_sample`, and EKF2 uses nothing that is older than {OLDEST:g} s: send it "
            "sooner, or correct the clock of the camera"
        )
    if case.has_utc(vehicle) and age < -_FUTURE:
        return (
            f"is {-age:.2f} s in the future by `timestamp_sample`, and PX4 takes the time of arrival instead: set the "
            "time of the measurement, in us of this computer's clock"
        )
    steps = [after - before for (_, before), (_, after) in pairwise(known)]
    if steps and median(steps) < NEAREST * 1e6:
        return (
            f"has a `timestamp_sample` each {median(steps) / 1e3:.1f} ms, and EKF2 drops what is nearer than "
            f"{NEAREST * 1e3:g} ms to the one before: send 10 to 50 a second, each with its own time"
        )
    return ""


def find_slow(case: Case) -> Iterator[Change]:
    """Find measurements that come too rarely."""
    for vehicle in case.alive:
        for name, each in measured(case, vehicle):
            if name == LOCAL and 0 < each.seen.rate < SLOWEST:
                yield case.change(
                    each.route.name,
                    f"'{each.route.name}' from {each.senders} comes at {each.seen.rate:.1f} Hz, and EKF2 starts to "
                    f"fuse at {SLOWEST:g} Hz: send 10 to 50 a second",
                )


def find_unfused(case: Case) -> Iterator[Change]:
    """Find measurements that EKF2 could use, and does not."""
    for vehicle in case.alive:
        flags, place = vehicle.state("estimator_status_flags"), vehicle.state("vehicle_local_position")
        for name, each in measured(case, vehicle) if flags else ():
            if not _is_good(case, vehicle, name, each):
                continue
            every = sorted(taken(each.values), key=lambda part: part.bit) if name == LOCAL else [PLACE]
            meant = [part for part in every if part.flag in flags]
            reasons = {part: why for part in meant if (why := reason(part, each.values, flags, place))}
            off = [part.flag for part in reasons if not flags[part.flag]]
            are = "are" if len(off) > 1 else "is"
            state = f"is not fused ({', '.join(off)} of estimator_status_flags {are} false)" if off else "is rejected"
            if reasons:
                why = "; ".join(dict.fromkeys(reasons.values()))
                yield case.change(each.route.name, f"'{each.route.name}' from {each.senders} {state}: {why}")


def _is_good(case: Case, vehicle: VehicleSeen, name: str, each: Sent) -> bool:
    """Whether nothing is wrong with measurements, which have been sent for some time."""
    is_known = each.seen.samples >= each.seen.rate * _SEEN and bool(each.values)
    is_fast = name == GLOBAL or each.seen.rate >= SLOWEST
    return is_known and is_fast and not _wrong_time(case, vehicle, each) and not [*_dropped(name, each.values)]
