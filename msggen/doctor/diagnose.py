"""From a case to a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msggen.base.diagnostics import counted, few
from msggen.check.finding import Finding, Report, Rule
from msggen.doctor.case import Case, message_of
from msggen.doctor.observation import InputSeen, VehicleSeen
from msggen.doctor.release import covered
from msggen.doctor.rules import DOCTOR
from msggen.link.link import Route
from msggen.messages.names import version_of


def diagnose(case: Case, rules: Sequence[Rule] = DOCTOR, *, is_brief: bool = False) -> Report:
    """Return the findings of rules in their order, and a summary that tells what was looked at.

    With `is_brief`, findings that follow from another release of the vehicle are left out.
    """
    every = [Finding(rule, change) for rule in rules for change in dict.fromkeys(rule.find(case))]
    effects = covered(case) if is_brief else frozenset()
    findings = tuple(finding for finding in every if finding.change not in effects)
    hidden = len(every) - len(findings)
    topics = sum(len(case.routes(vehicle)) for vehicle in case.vehicles)
    verdict = f"{counted(len(findings), 'problem')} found" if findings else "no problem found"
    return Report(
        previous="",
        current=case.seen.link,
        rules=tuple(rules),
        findings=findings,
        compared=topics,
        summary=f"{verdict}: {_looked_at(case)}",
        advice=f"--verbose lists {counted(hidden, 'difference')} of the release" if hidden else "",
        answers=tuple(_answers(case)),
    )


def _looked_at(case: Case) -> str:
    """Return what was looked at."""
    seen = case.seen
    if not case.vehicles:
        others = [str(vehicle.remote) for vehicle in seen.vehicles if vehicle.routes]
        return f"{seen.link}, {f'only {few(others)}' if others else f'no vehicle in {seen.waited:.0f} s'}"
    parts = [seen.link, *(_vehicle(case, vehicle) for vehicle in case.vehicles[:3])]
    if len(case.vehicles) > len(parts) - 1:
        parts.append(f"{len(case.vehicles) - 3} more vehicles")
    samples = sum(
        vehicle.topics[route.name].samples
        for vehicle in case.vehicles
        for route in case.routes(vehicle)
        if route.name in vehicle.topics
    )
    return f"{', '.join(parts)}, {counted(samples, 'sample')} in {seen.seconds:.1f} s"


def _vehicle(case: Case, vehicle: VehicleSeen) -> str:
    routes = case.routes(vehicle)
    heard = sum(route.name in vehicle.topics for route in routes)
    hashes = len({route.ros_type for route in routes} & vehicle.hashes.keys())
    release = f" with PX4 {vehicle.release}" if vehicle.release else ""
    return (
        f"{vehicle.remote}{release}: {counted(len(routes), 'topic')}, {heard} heard, "
        f"{counted(hashes, 'definition')} compared with {case.expected_by(vehicle).label}"
    )


def _answers(case: Case) -> Iterator[str]:
    """Yield who publishes each topic that the user has named and that a vehicle reads, and how."""
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
