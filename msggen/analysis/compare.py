"""How two flights differ: findings, figures, firmware and hardware, parameters, devices and topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from msggen.analysis import devices
from msggen.analysis.figures import facts_of, figures_of
from msggen.analysis.finding import LEVELS, Finding, Findings, FlightRule
from msggen.analysis.findings import findings_of
from msggen.analysis.flight import Flight, flight_of
from msggen.analysis.rules.table import TOPICS as OF_RULES
from msggen.base.diagnostics import few
from msggen.base.recording_formats import FORMATS
from msggen.messages.vehicle_types import ROVER
from msggen.recordings.source.facts import is_same

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log

SIDES = "A", "B"
"""What the two flights are called, in their order."""
_IDENTITY = "Vehicle", "Board", "Airframe", "Firmware", "Commit", "System"
"""The facts that are the same for two flights of one vehicle."""
_SHARE = 0.1
"""The share of the larger rate from which rates differ."""
_FEWEST = 10
"""The samples that a topic needs for a rate."""
_OF_FIGURES = frozenset(
    {
        *("vehicle_local_position", "vehicle_odometry", "vehicle_global_position", "vehicle_attitude"),
        *("sensor_gps", "vehicle_gps_position", "actuator_armed", "vehicle_land_detected", "battery_status"),
    }
)


Value: TypeAlias = "str | float | None"
"""A text or a number. None: the flight does not have it."""


class Difference(NamedTuple):
    """A value of both flights."""

    name: str
    first: Value
    second: Value


class Told(NamedTuple):
    """What a rule says of each flight."""

    rule: FlightRule
    first: tuple[Finding, ...]
    second: tuple[Finding, ...]
    unsaid: tuple[str, str]
    """Why it cannot say anything of a flight, "" if it can."""

    @property
    def level(self) -> str:
        """The worst level."""
        return min((each.level for each in (*self.first, *self.second)), key=LEVELS.index)

    @property
    def is_of_one(self) -> bool:
        """Whether only one of the flights has such a finding."""
        return not (self.first and self.second)


class Moment(NamedTuple):
    """What happened in both flights, and when, in s after the start of each recording."""

    name: str
    """`takeoff`, `arming` or `start`."""
    first: float
    second: float


@dataclass(frozen=True)
class Comparison:
    """How two flights differ."""

    moment: Moment
    """When both flights are at the same point."""
    findings: tuple[Told, ...]
    """The rules that found something: first those of one flight, then those of both; the worst ones first."""
    figures: tuple[Difference, ...]
    """The flights in numbers, also those that are the same."""
    facts: tuple[Difference, ...]
    """What differs of vehicle, board and firmware."""
    devices: tuple[Difference, ...]
    """The devices that only one has, or whose calibration, versions or serial number differ."""
    parameters: tuple[Difference, ...]
    """The parameters that differ at the start."""
    rates: tuple[Difference, ...]
    """The topics whose rates in Hz differ by 10 % or more."""
    topics: tuple[tuple[str, ...], tuple[str, ...]]
    """The topics that only the first flight has, and only the second."""
    notes: tuple[str, ...]
    """What cannot be compared."""

    @property
    def is_empty(self) -> bool:
        """Whether nothing differs."""
        has_findings = any(each.is_of_one for each in self.findings)
        has_figures = any(each.first != each.second for each in self.figures)
        others = self.facts, self.devices, self.parameters, self.rates, *self.topics
        return not (has_findings or has_figures or any(others))


def comparable(log: Log, is_needed: Callable[[str], bool] = frozenset().__contains__) -> Flight:
    """Return the flight in a recording with the topics that `compare` reads, and those that `is_needed` takes."""
    names = OF_RULES | devices.TOPICS | _OF_FIGURES
    return flight_of(log, lambda name: name in names or is_needed(name))


def compare(first: Flight, second: Flight) -> Comparison:
    """Return how two flights differ. Each has at least the topics of `comparable`."""
    with np.errstate(all="ignore"):  # damaged samples have values of any size
        return Comparison(
            _moment(first, second),
            _findings(findings_of(first), findings_of(second)),
            _joined(_figures(first), _figures(second)),
            _differing(_facts(first), _facts(second)),
            _differing(_devices(first), _devices(second)),
            _parameters(first, second),
            _rates(first, second),
            _topics(first, second),
            tuple(_notes(first, second)),
        )


def _moment(first: Flight, second: Flight) -> Moment:
    for name, find in (("takeoff", _takeoff), ("arming", _arming)):
        one, other = find(first), find(second)
        if one is not None and other is not None:
            return Moment(name, one, other)
    return Moment("start", 0.0, 0.0)


def _takeoff(flight: Flight) -> float | None:
    """Return when the vehicle first left the ground, None if the recording does not have that, or for a rover."""
    landed = flight.recorded.column("vehicle_land_detected", "landed")
    kind = flight.recorded.column("vehicle_status", "vehicle_type")
    if landed is None or (kind is not None and kind.values[-1] == ROVER):  # "landed" is a rover that is disarmed
        return None
    taken_off = np.flatnonzero((landed.values[:-1] > 0) & (landed.values[1:] == 0))
    return float(landed.times[taken_off[0] + 1]) if len(taken_off) else None


def _arming(flight: Flight) -> float | None:
    """Return when the vehicle was armed first. A ULog begins then, other recordings can begin in flight."""
    recorded = flight.recorded
    if not recorded.armed or not ("vehicle_status" in recorded or "actuator_armed" in recorded):
        return None
    begin = recorded.armed[0][0]
    return begin if begin > 0 or FORMATS[recorded.log.kind].is_of_vehicle else None


def _findings(first: Findings, second: Findings) -> tuple[Told, ...]:
    rules = {each.rule.id: each.rule for each in (*first.findings, *second.findings)}
    told = (
        Told(rule, _of(rule, first), _of(rule, second), (_unsaid(rule, first), _unsaid(rule, second)))
        for rule in rules.values()
    )
    return tuple(sorted(told, key=lambda each: (not each.is_of_one, LEVELS.index(each.level))))


def _of(rule: FlightRule, findings: Findings) -> tuple[Finding, ...]:
    return tuple(each for each in findings.findings if each.rule.id == rule.id)


def _unsaid(rule: FlightRule, findings: Findings) -> str:
    return few([each.reason for each in findings.silences if each.rule.id == rule.id])


def _figures(flight: Flight) -> dict[str, str]:
    figures = figures_of(flight.recorded, flight.track)
    return {each.name: each.value + (f" ({each.note})" if each.note else "") for each in figures}


def _facts(flight: Flight) -> dict[str, str]:
    return {each.name: each.value for each in facts_of(flight.recorded) if each.name in _IDENTITY and each.value}


def _devices(flight: Flight) -> dict[str, str]:
    """Return what is known of devices, by kind, type and place."""
    found: dict[str, str] = {}
    for each in devices.devices_of(flight.recorded):
        found[f"{each.kind}: {each.model} ({each.bus})"] = ", ".join(filter(None, (each.state, each.about))) or "seen"
    return found


def _joined(first: Mapping[str, str | float], second: Mapping[str, str | float]) -> tuple[Difference, ...]:
    """Return the values of both, in the order of the first."""
    return tuple(Difference(name, first.get(name), second.get(name)) for name in {**first, **second})


def _differing(first: Mapping[str, str | float], second: Mapping[str, str | float]) -> tuple[Difference, ...]:
    return tuple(each for each in _joined(first, second) if not is_same(each.first, each.second))


def _parameters(first: Flight, second: Flight) -> tuple[Difference, ...]:
    one, other = first.log.parameters, second.log.parameters
    return tuple(sorted(_differing(one, other))) if one and other else ()


def _rates(first: Flight, second: Flight) -> tuple[Difference, ...]:
    one, other = _measured(first), _measured(second)
    return tuple(
        Difference(name, rate, other[name])
        for name, rate in one.items()
        if name in other and abs(rate - other[name]) >= _SHARE * max(rate, other[name])
    )


def _measured(flight: Flight) -> dict[str, float]:
    """Return the rates in Hz of the topics that have enough samples."""
    topics = flight.recorded.all_topics
    return {name: topic.rate for name, topic in topics.items() if topic.count >= _FEWEST and topic.rate}


def _topics(first: Flight, second: Flight) -> tuple[tuple[str, ...], tuple[str, ...]]:
    one, other = first.recorded.all_topics, second.recorded.all_topics
    return tuple(name for name in one if name not in other), tuple(name for name in other if name not in one)


def _notes(*flights: Flight) -> Iterator[str]:
    for side, flight in zip(SIDES, flights, strict=True):
        shown, others = flight.recorded.namespace or "the vehicle without a namespace", flight.recorded.others
        if others:
            yield f"{side} is {shown}, not: {few(others)}"
    without = [side for side, flight in zip(SIDES, flights, strict=True) if not flight.log.parameters]
    if without:
        yield f"the parameters are not compared: {' and '.join(without)} {'has' if len(without) == 1 else 'have'} none"
    kinds = [flight.log.kind for flight in flights]
    if kinds[0] != kinds[1]:
        names = " and ".join(FORMATS[kind].name for kind in kinds)
        yield f"{names} recorders write different topics, at different rates, also of one flight"
