"""What a comparison finds, and what a rule is: an ID, a purpose, a category and a function, nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from msggen.diagnostics import Diagnostic
from msggen.location import Location

if TYPE_CHECKING:
    from msggen.compare.comparison import Comparison


class Category(Enum):
    """What a finding breaks, said in a sentence."""

    WIRE = "the bytes change: readers and writers built with the other definition misread them"
    HASH = "the same bytes, but the firmware's compatibility check refuses the other definition"
    SOURCE = "source code that uses the definition no longer builds, or means something else"
    SEMANTIC = "the same bytes and names, but the values mean something else"
    TOPIC = "a topic of the bridge is not where applications look for it"
    VERSION = "the firmware's rules for versions of messages are not kept"
    DRIFT = "one side has what the other lacks; nothing breaks, but they are not the same"


class Severity(Enum):
    """Whether a finding fails the run."""

    ERROR = "error"
    WARNING = "warning"


class Reader(Enum):
    """Who decodes samples of the other side: nodes built with the previous definition, or with the current one."""

    OLD = "old"
    NEW = "new"


@dataclass(frozen=True, slots=True)
class Excerpt:
    """One line of one side: where it stands, and what it says, without its comment."""

    location: Location
    text: str


@dataclass(frozen=True, slots=True)
class Change:
    """What a rule found. `location` is in the current side; `before` and `after` are the lines that differ.

    `subject` is the name of a message, a service or a topic.
    """

    subject: str
    message: str
    location: Location
    before: Excerpt | None = None
    after: Excerpt | None = None


@dataclass(frozen=True, slots=True)
class Rule:
    """One thing to look for. `find` compares the two sides and yields what it finds."""

    id: str
    purpose: str
    category: Category
    find: Callable[[Comparison], Iterable[Change]]
    severity: Severity = Severity.ERROR


@dataclass(frozen=True, slots=True)
class Finding:
    """A change, the rule that found it, and what follows.

    It is silent where the size stays, so that some readers decode wrong values without an error: `silent_for` says
    which. It is handled where a complete new version of the message takes care of it.
    """

    rule: Rule
    change: Change
    silent_for: tuple[Reader, ...] = ()
    is_handled: bool = False

    @property
    def is_silent(self) -> bool:
        """Whether any reader decodes wrong values without an error."""
        return bool(self.silent_for)

    @property
    def fails(self) -> bool:
        """Whether the run fails because of it."""
        return self.rule.severity is Severity.ERROR and not self.is_handled


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that one comparison says: the names of both sides, the rules that were asked, what they found.

    `summary` is one line for people; `compared` counts the messages and services that both sides have. `notices` are
    the warnings and notes about the sources, which no rule has found.
    """

    previous: str
    current: str
    rules: tuple[Rule, ...]
    findings: tuple[Finding, ...]
    compared: int
    summary: str
    notices: tuple[Diagnostic, ...] = ()

    @property
    def fails(self) -> bool:
        """Whether any finding fails the run."""
        return any(finding.fails for finding in self.findings)
