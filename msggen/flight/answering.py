"""What a program answers arming checks for: a mode, or a check without a mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, TypeVar

from msggen.flight.checks import Health, Problem, Requirement, Verdict
from msggen.flight.elsewhere import Hinted
from msggen.flight.errors import FlightError, report
from msggen.flight.registration import Ids

_Found = TypeVar("_Found")


class Answering(Hinted):
    """What modes and checks have in common. Its name is that of the class statement, the body, or the class."""

    name: ClassVar[str]
    _active: object = None

    def __init_subclass__(cls, name: str = "", **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.name = name or cls.__dict__.get("name") or cls.__name__

    def problems(self) -> Sequence[Problem]:
        """Return the unmet conditions. It is called several times a second, and must return at once.

        While there are any, PX4 does not enter the mode, or leaves it. For a check, it does not arm in any mode.
        """
        return ()

    def health(self) -> Health | None:
        """Return the health of a component, for ground stations. It is called as `problems` is."""
        return None

    @property
    def is_registered(self) -> bool:
        """Whether a flight has registered it."""
        return self._active is not None


class Check(Answering):
    """A check without a mode: while `problems` returns any, the vehicle does not arm, in no mode.

    It has no effect in flight: the vehicle neither leaves a mode nor refuses one.

    **A check that does not answer permits arming.** PX4 removes it about 1 s after its program has died, hangs, or has
    lost the link. Something that must hold the vehicle back needs a second way that does not depend on the program.
    """


class Active:
    """A mode or a check with the ids that the vehicle has assigned."""

    def __init__(self, subject: Answering, ids: Ids) -> None:
        self.subject, self.ids = subject, ids
        self._failed: set[str] = set()
        """The methods that have raised an exception, which was reported."""
        subject._active = self  # noqa: SLF001 - its own part

    @property
    def can_run(self) -> bool:
        """Whether nothing but its problems is against it."""
        return True

    @property
    def requires(self) -> Requirement:
        """What PX4 requires for it."""
        return Requirement.NONE

    def verdict(self) -> Verdict:
        """Return the reply to an arming check. If `problems` raises an exception, the reply is that it cannot run."""
        problems = self._asked("problems", lambda: _problems(self.subject.problems()))
        health = self._asked("health", lambda: _health(self.subject.health()))
        return Verdict(problems is not None and self.can_run, self.requires, problems or (), health)

    def follow(self, status: Any) -> None:
        """Take a VehicleStatus."""

    def lose(self, error: FlightError) -> None:
        """Take that the vehicle no longer knows it, with the reason."""

    def close(self) -> None:
        """End it."""
        self.subject._active = None  # noqa: SLF001 - as above

    def _asked(self, method: str, ask: Callable[[], _Found]) -> _Found | None:
        """Return what a method of a program returns, None if it fails. Only the first failure in a row is reported."""
        try:
            found = ask()
        except Exception as error:  # noqa: BLE001 - whatever a program raises
            if method not in self._failed:
                kind = "check" if isinstance(self.subject, Check) else "mode"
                report(f"`{method}` of {kind} {self.subject.name!r} has failed", error)
            self._failed.add(method)
            return None
        self._failed.discard(method)
        return found


def _problems(found: Sequence[Problem]) -> Sequence[Problem]:
    problems = tuple(found)
    for each in problems:
        if not isinstance(each, Problem):
            raise TypeError(f'expected a sequence of Problem, such as [Problem("my_event")], got {each!r}')
    return problems


def _health(found: Health | None) -> Health | None:
    if found is not None and not isinstance(found, Health):
        raise TypeError(f"expected a Health, such as Health(Component.PAYLOAD), or None, got {found!r}")
    return found
