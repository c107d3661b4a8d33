"""A vehicle with another release than the types: one finding instead of one for each topic and definition."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.base.diagnostics import counted
from msggen.check.finding import Change
from msggen.doctor import naming, samples
from msggen.doctor.case import Case
from msggen.doctor.observation import VehicleSeen

_MANY = 5
"""The differences from which on the release is another one."""
_KINDS = (
    (naming.find_version, "topic", " with another version suffix"),
    (samples.find_unknown_types, "unknown message", ""),
    (samples.find_differing, "other definition", ""),
)


def find_release(case: Case) -> Iterator[Change]:
    """Find vehicles with another release than the types."""
    for vehicle in _others(case):
        only, expected = _only(case, vehicle), case.expected_by(vehicle)
        counts = [(len(list(find(only))), noun, how) for find, noun, how in _KINDS]
        what = ", ".join(counted(count, noun) + how for count, noun, how in counts if count)
        release = f"PX4 {vehicle.release}" if vehicle.release else "a firmware that is no known release"
        source = vehicle.release or "PX4-Autopilot"
        yield case.of(
            vehicle,
            f"has {release}, and {expected.label} is not of that: {what}; build the types of its firmware, `msggen "
            f"build --px4 {source}`; in ROS 2, use the branch of px4_msgs for its release",
        )


def covered(case: Case) -> frozenset[Change]:
    """Return the findings that follow from another release."""
    finders = (*(find for find, *_ in _KINDS), naming.find_not_bridged)
    return frozenset(change for vehicle in _others(case) for find in finders for change in find(_only(case, vehicle)))


def _others(case: Case) -> Iterator[VehicleSeen]:
    """Yield the vehicles with many differences."""
    for vehicle in case.vehicles if not case.wanted else ():
        only = _only(case, vehicle)
        if sum(1 for find, *_ in _KINDS for _ in find(only)) >= _MANY:
            yield vehicle


def _only(case: Case, vehicle: VehicleSeen) -> Case:
    """Return a case of a vehicle, without other programs."""
    return case._replace(seen=case.seen._replace(vehicles=(vehicle,), readers=(), writers=()))
