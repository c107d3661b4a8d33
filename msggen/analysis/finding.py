"""What rules about flights are, and what they say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from msggen.check.finding import Category, Rule, Severity

LEVELS = "error", "warning", "info"
"""How much a finding matters, the most first."""
FAILING = LEVELS[:2]
"""The levels of findings that somebody has to look at."""
_NOTHING: Mapping[str, float | str] = MappingProxyType({})


class Seen(NamedTuple):
    """What a rule has seen."""

    text: str
    """What was seen, with the worst value and its unit."""
    time: float | None = None
    """When it began, in s after the start of the recording; None if it has no time."""
    end: float | None = None
    """When it ended for the last time, in s."""
    values: Mapping[str, float | str] = _NOTHING
    """The evidence, by names that end in units: `vibration_m_s2`, `limit_m_s2`."""
    level: str = ""
    """One of `LEVELS`; "" is the severity of the rule."""


class Unsaid(NamedTuple):
    """Why a rule cannot say whether there is a finding."""

    reason: str


@dataclass(frozen=True, slots=True)
class FlightRule(Rule):
    """A rule about a flight. `find` takes a Flight and yields what it has seen, or why it cannot say.

    A rule is asked if the recording has one of each of its `needs`; otherwise it says which one is missing.
    """

    category: Category = field(default=Category.FLIGHT, init=False)
    severity: Severity = Severity.WARNING
    needs: tuple[tuple[str, ...], ...] = ()
    """Topics, or fields such as `battery_status.remaining`: one of each tuple must have a number."""
    uses: tuple[str, ...] = ()
    """Topics that it reads where the recording has them."""
    source: str = ""
    """Where its limits are from: a check or a parameter of PX4, or a measurement."""
    example: str = ""
    """A text that it says."""

    @property
    def topics(self) -> frozenset[str]:
        """The topics that the rule reads."""
        paths = [path for paths in self.needs for path in paths]
        return frozenset(path.partition(".")[0] for path in (*paths, *self.uses))

    @property
    def is_about_flight(self) -> bool:
        """Whether it looks only while the vehicle is armed: such rules read what tells that."""
        return "actuator_armed" in self.topics


class Finding(NamedTuple):
    """Something that a reader should know."""

    rule: FlightRule
    level: str
    text: str
    time: float | None = None
    end: float | None = None
    values: Mapping[str, float | str] = _NOTHING


class Silence(NamedTuple):
    """A rule that could not be answered, and why."""

    rule: FlightRule
    reason: str


@dataclass(frozen=True)
class Findings:
    """What the rules say about a flight."""

    findings: tuple[Finding, ...]
    """The worst ones first, then in the order of time."""
    silences: tuple[Silence, ...] = ()
    """The rules that cannot say anything."""
    clear: tuple[FlightRule, ...] = field(default=())
    """The rules that looked and found nothing."""
