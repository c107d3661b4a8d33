"""Rules and findings, of comparisons and of single definitions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

from msggen.base.diagnostics import Diagnostic
from msggen.base.location import Location


class Category(Enum):
    """The category of a rule. The value is a sentence about the effect of its findings."""

    WIRE = "the bytes of samples changed, so nodes built with the other definition misread them"
    HASH = "the bytes are the same, but the firmware's compatibility check rejects the other definition"
    SOURCE = "source code that uses the definition no longer builds, or changes its behavior"
    SEMANTIC = "bytes and names are the same, but the values mean something else"
    TOPIC = "applications no longer find a bridged topic, or find it with other properties"
    VERSION = "the change breaks the firmware's rules for versioned messages"
    DRIFT = "nothing breaks, but the sides are not the same"
    TAG = "a tag in a comment cannot be read, so tools do not know what the values mean"
    UNIT = "the unit of a field is unknown, or does not fit the fields beside it"
    ENUM = "it is unclear which constants are the values of a field"
    FRAME = "the axes of a vector are unknown, so its values can be read in a wrong frame"
    DOCUMENTATION = "people have to guess what a value means"
    LAYOUT = "samples are larger than they need to be"
    LINK = "no vehicle is connected, so nothing can arrive"
    SESSION = "a vehicle is there, but its session does not last or does not begin"
    NAME = "samples do not arrive, because the vehicle has no endpoint that matches"
    DEFINITION = "samples arrive, but are decoded with another definition, or not at all"
    TIME = "samples arrive, but their timestamps are those of another clock"
    FLOW = "samples arrive rarely, or some of them do not arrive"
    MEASUREMENT = "programs send measurements, but the vehicle's estimator does not use them"
    SETPOINT = "programs send setpoints, but the vehicle does not follow them"
    FLIGHT = "a recording shows that the vehicle, its setup or its surroundings were not as they should be"


OF_VEHICLES = (
    Category.LINK,
    Category.SESSION,
    Category.NAME,
    Category.DEFINITION,
    Category.TIME,
    Category.FLOW,
    Category.MEASUREMENT,
    Category.SETPOINT,
    Category.FLIGHT,
)
"""The categories of what is, or was, wrong with a vehicle. Their findings are about no lines of a file."""


class Effect(Enum):
    """What a change of definitions does, the worst first. The value is how a report calls it."""

    SILENT = "silent"
    """Readers decode wrong values without an error."""
    WIRE = "wire"
    """Nodes with the other definition get no samples, refuse them, or misread them."""
    BUILD = "build"
    """Source code that uses the definition no longer builds, or changes its behavior."""
    OTHER = "other"


_EFFECTS = {
    Category.WIRE: Effect.WIRE,
    Category.HASH: Effect.WIRE,
    Category.TOPIC: Effect.WIRE,
    Category.SOURCE: Effect.BUILD,
}


class Node(Enum):
    """The nodes that decode samples of the other side: those built with the previous or the current definition."""

    OLD = "old"
    NEW = "new"


class Severity(Enum):
    """The severity of a rule: an error fails the run, a warning does not."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Excerpt:
    """A line of one side: its location and its text. Comparisons leave out the comment of the line."""

    location: Location
    text: str


@dataclass(frozen=True, slots=True)
class Change:
    """A change that a rule found. `location` is on the current side; `before` and `after` are the lines that differ.

    In a finding of `lint`, which has no previous side, `before` is None.

    `subject` is the name of a message, a service or a topic. `names` are those of the fields and constants that
    changed, on both sides. A translation that handles the change deals with all of them.
    """

    subject: str
    message: str
    location: Location
    before: Excerpt | None = None
    after: Excerpt | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule. `find` yields the changes in a Comparison, a Definition or a vehicle's Case, or what a flight shows.

    `fix` says what to do about them.

    A rule that is not a default is only applied if it is selected.
    """

    id: str
    purpose: str
    category: Category
    find: Callable[[Any], Iterable[Any]]
    fix: str
    severity: Severity = Severity.ERROR
    is_default: bool = True


@dataclass(frozen=True, slots=True)
class Finding:
    """A change, the rule that found it, and its effect.

    A finding is silent if the size of samples stays the same, so that the readers in `silent_for` decode wrong values
    without an error. It is handled if a complete new version of the message covers the change. `remedy` is the command
    that makes the finding disappear, "" if there is none. Remedies run in the order of their `rank`.
    """

    rule: Rule
    change: Change
    silent_for: tuple[Node, ...] = ()
    is_handled: bool = False
    remedy: str = ""
    rank: int = 0

    @property
    def is_silent(self) -> bool:
        """Whether any reader decodes wrong values without an error."""
        return bool(self.silent_for)

    @property
    def effect(self) -> Effect:
        """What the change does. A warning stops nothing."""
        if self.is_silent:
            return Effect.SILENT
        return (
            Effect.OTHER if self.rule.severity is Severity.WARNING else _EFFECTS.get(self.rule.category, Effect.OTHER)
        )

    @property
    def fails(self) -> bool:
        """Whether the finding fails the run."""
        return self.rule.severity is Severity.ERROR and not self.is_handled


@dataclass(frozen=True, slots=True)
class Resized:
    """A message whose bytes changed: the sizes of a sample on both sides in bytes, None if they vary.

    `topics` are the bridged topics that carry the message, also inside another one.
    """

    name: str
    before: int | None
    after: int | None
    silent_for: tuple[Node, ...]
    topics: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """The result of a command: the names of both sides, the rules that were applied, and their findings.

    `lint` has no previous side: `previous` is "". `compared` is the number of messages and services that both sides
    have, or that `lint` read. `summary` is one line for people. `notices` are the warnings and notes about the sources;
    they are not findings. `advice` is a line on what to do about the whole report, "" if the findings say it. `ignored`
    is the number of findings that were ignored. `answers` are lines about what the user has asked. `unmatched` has the
    names to ignore that match nothing, each with a hint for the user. `messages` are those of both sides whose bytes
    changed.
    """

    previous: str
    current: str
    rules: tuple[Rule, ...]
    findings: tuple[Finding, ...]
    compared: int
    summary: str
    notices: tuple[Diagnostic, ...] = ()
    advice: str = ""
    ignored: int = 0
    answers: tuple[str, ...] = ()
    unmatched: Mapping[str, str] = field(default_factory=dict)
    messages: tuple[Resized, ...] = ()

    def only(self, effect: Effect) -> Report:
        """Return the report with only the findings that have this effect. The summary counts all of them."""
        return replace(self, findings=tuple(finding for finding in self.findings if finding.effect is effect))

    @property
    def fails(self) -> bool:
        """Whether any finding fails the run."""
        return any(finding.fails for finding in self.findings)
