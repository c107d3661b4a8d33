"""Answers about topics that the user has named and that a vehicle reads: who publishes them, and how."""

from __future__ import annotations

from collections.abc import Iterator

from msggen.base.diagnostics import few
from msggen.doctor.case import Case, message_of
from msggen.doctor.observation import InputSeen, VehicleSeen
from msggen.live.link import Route
from msggen.live.messages.names import version_of


def answers(case: Case) -> Iterator[str]:
    """Yield a line for each of these topics."""
    for vehicle in case.vehicles if case.wanted else ():
        for route in case.routes(vehicle):
            if route.direction == "in":
                yield _answer(case, vehicle, route)


def _answer(case: Case, vehicle: VehicleSeen, route: Route) -> str:
    if not case.seen.hears_programs:
        return f"{route.name}: not known who publishes it, because this command owns the link; leave out --direct"
    seen = vehicle.inputs.get(route.name, InputSeen())
    if not seen.samples:
        return f"{route.name}: no program publishes it"
    senders = few([f"{each} at {each.rate:.1f} Hz" for each in seen.programs if each.samples])
    gap = f"{senders or f'an unknown program at {seen.rate:.1f} Hz'}, with up to {seen.longest:.2f} s between two"
    return f"{route.name}: published by {gap}; {_verdict(vehicle, route, seen)}"


def _verdict(vehicle: VehicleSeen, route: Route, seen: InputSeen) -> str:
    """Return whether the vehicle accepts the samples."""
    newest = seen.last[-1]
    if newest.problem:
        return f"not accepted, {newest.problem}"
    kind = f"{message_of(route)} version {version_of(route.name)}, {seen.size - 4} bytes"
    if newest.values:
        told = "the vehicle's definition" if route.ros_type in vehicle.hashes else "the definition of its release"
        return f"accepted ({kind}, {told})"
    return f"not known whether it is accepted ({kind}), because the definition of the vehicle is not known"
