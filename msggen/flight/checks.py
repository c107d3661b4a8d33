"""Arming checks of PX4: what modes and checks of a program need, and what it replies for them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import Flag, IntEnum, auto
from functools import reduce
from operator import or_
from typing import Any, ClassVar, Final, NamedTuple, TypeVar

from msggen.base.diagnostics import suggestion
from msggen.flight.errors import FlightError, report
from msggen.flight.feeds import Connection, Feeds, Topics, filled
from msggen.flight.registration import Ids
from msggen.flight.usage import Hinted
from msggen.messages.events import COMPONENT, SIZE, Component, event_id, packed

_Found = TypeVar("_Found")
_MOST_AT_ONCE = 4
"""How many replies PX4's queue holds before v1.18."""
_PAUSE = 0.012
"""The time in s within which PX4's commander reads the replies."""
_AGAIN = 0.1
"""The time in s after which a reply is sent again, because the first one can get lost."""
_OVERDUE = 0.33
"""The time in s after a request by which the next one is overdue: PX4 sends one every 0.31 s."""
_INTERVAL = 0.314
_MOST_LOST = 3
"""How many overdue requests in a row are answered."""
_NUMBERS = 256
_MOST_EVENTS = 5


class Requirement(Flag):
    """Requirements of a mode, to be combined with `|`: `mode_req_...` of ArmingCheckReply."""

    NONE = 0
    ANGULAR_VELOCITY = auto()
    ATTITUDE = auto()
    LOCAL_ALT = auto()
    LOCAL_POSITION = auto()
    LOCAL_POSITION_RELAXED = auto()
    """A local position of low accuracy is enough."""
    GLOBAL_POSITION = auto()
    MISSION = auto()
    HOME_POSITION = auto()
    MANUAL_CONTROL = auto()
    """Stick input of a pilot."""
    PREVENT_ARMING = auto()
    """The vehicle is not armed in this mode."""

    @property
    def fields(self) -> frozenset[str]:
        """The names of the fields of ArmingCheckReply that are set."""
        return frozenset(f"mode_req_{each.name.lower()}" for each in Requirement if each in self and each.name)


ATTITUDE = Requirement.ANGULAR_VELOCITY | Requirement.ATTITUDE
"""What attitude setpoints need."""
LOCAL_POSITION = ATTITUDE | Requirement.LOCAL_ALT | Requirement.LOCAL_POSITION
"""What goto and trajectory setpoints need."""
GLOBAL_POSITION = LOCAL_POSITION | Requirement.GLOBAL_POSITION
"""What goto setpoints by latitude and longitude need."""


def named(names: Iterable[str]) -> Requirement:
    """Return the requirements with names such as `local_position`."""
    return reduce(or_, (Requirement[name.upper()] for name in names), Requirement.NONE)


class Severity(IntEnum):
    """Severities of events in PX4."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


@dataclass(frozen=True)
class Problem:
    """An unmet condition of a program: of a mode, which PX4 then does not enter, or leaves; or of a check.

    A ground station shows a text only if its event metadata contains the id of `event`.

    Raises TypeError and ValueError for what an event cannot have.
    """

    event: str
    """The name of the event, such as `my_mode_no_target`."""
    severity: Severity = Severity.ERROR
    arguments: Sequence[tuple[str, float]] = ()
    """The arguments of the event: each a type of event metadata, such as `uint8_t` or `float`, and a value. 20 bytes
    at most. In the metadata, two arguments of PX4 come before them: a `uint32_t` with modes, a `uint8_t` with the
    component."""
    text: str = ""
    """What it means, for people: in the errors and logs of this program. The vehicle does not get it."""

    def __post_init__(self) -> None:
        if not isinstance(self.event, str):
            raise TypeError(f'expected the name of an event, such as "my_mode_no_target", got {self.event!r}')
        if not isinstance(self.severity, Severity):
            raise TypeError(f"expected a Severity, such as Severity.WARNING, got {self.severity!r}")
        event_id(self.event)
        packed(self.arguments)

    def __str__(self) -> str:
        return f"{self.event}: {self.text}" if self.text else self.event

    @property
    def number(self) -> int:
        """The id of the event."""
        return event_id(self.event)


@dataclass(frozen=True)
class Health:
    """The health of a component of the vehicle, for ground stations. PX4 reports it, and does nothing else with it.

    Raises TypeError for what is no Component.
    """

    component: Component
    is_present: bool = True
    has_warning: bool = False
    has_error: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.component, Component):
            name = self.component.upper() if isinstance(self.component, str) else ""
            nearest = suggestion(name, Component.__members__)
            raise TypeError(f"expected a Component, such as Component.PAYLOAD, got {self.component!r}{nearest}")


_NO_HEALTH: Final = Health(Component.NONE, is_present=False)


class Verdict(NamedTuple):
    """What a program replies to an arming check."""

    can_run: bool = True
    requires: Requirement = Requirement.NONE
    problems: Sequence[Problem] = ()
    health: Health | None = None


class Answers:
    """Replies at once to the requests of the vehicle, for all checks of a program.

    PX4 gives up a mode after three or four requests without a reply. So that a lossy link does not end flights, each
    reply is sent twice, and overdue requests are answered before they arrive: their numbers are known.
    """

    def __init__(self, connection: Connection, feeds: Feeds) -> None:
        self._connection = connection
        topics = Topics(connection.package)
        self._class = topics.incoming("arming_check_reply")
        self._has_short_queue = not topics.has("in", "setpoint_config")
        self._checks: dict[int, Callable[[], Verdict]] = {}
        self._only_asked: set[int] = set()
        self._asked = 0
        """The checks that the last request says that it is for, as a mask of bits: from v1.17 on."""
        self._loop = asyncio.get_running_loop()
        self._end = feeds["arming_check_request"].call(self._take)
        self._timers: list[asyncio.TimerHandle] = []
        """The replies to the last request that are still to be sent."""

    def add(self, check: int, verdict: Callable[[], Verdict], *, only_asked: bool = False) -> None:
        """Reply for the check with an id. With `only_asked`, only to requests whose mask contains the check."""
        self._checks[check] = verdict
        (self._only_asked.add if only_asked else self._only_asked.discard)(check)

    def remove(self, check: int) -> None:
        """Stop replying for a check."""
        self._checks.pop(check, None)

    def close(self) -> None:
        """Stop replying."""
        self._checks.clear()
        self._cancel()
        self._end()

    def _cancel(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    def _take(self, request: Any) -> None:
        self._cancel()
        self._asked = getattr(request, "valid_registrations_mask", 0)
        number = request.request_id
        self._answer(number)
        self._later(_AGAIN, self._answer, number)
        for lost in range(_MOST_LOST):
            self._later(_OVERDUE + lost * _INTERVAL, self._answer, (number + 1 + lost) % _NUMBERS)

    def _answer(self, number: int) -> None:
        for index, check in enumerate(sorted(self._checks)):
            if check in self._only_asked and not self._asked >> check & 1:
                continue
            turn = index // _MOST_AT_ONCE if self._has_short_queue else 0
            if turn:
                self._later(turn * _PAUSE, self._reply, number, check)
            else:
                self._reply(number, check)

    def _later(self, seconds: float, call: Callable[..., None], *values: int) -> None:
        self._timers.append(self._loop.call_later(seconds, call, *values))

    def _reply(self, number: int, check: int) -> None:
        verdict = self._checks.get(check)
        if verdict is None:
            return
        found = verdict()
        health = found.health or _NO_HEALTH
        events = [self._event(each, health.component) for each in found.problems[:_MOST_EVENTS]]
        reply = filled(
            self._class,
            request_id=number,
            registration_id=check,
            health_component_index=health.component,
            health_component_is_present=bool(health.is_present),
            health_component_warning=bool(health.has_warning),
            health_component_error=bool(health.has_error),
            can_arm_and_run=found.can_run and not found.problems,
            num_events=len(events),
            **dict.fromkeys(found.requires.fields, True),
        )
        reply.events = (*events, *reply.events[len(events) :])
        self._connection.publish("arming_check_reply", reply)

    def _event(self, problem: Problem, component: Component) -> Any:
        cls = type(self._class().events[0])
        levels = problem.severity << 4 | problem.severity  # for the log, and for ground stations
        arguments = bytes([*bytes(COMPONENT), component]) + packed(problem.arguments)
        return cls(id=problem.number, log_levels=levels, arguments=arguments.ljust(SIZE, b"\0"))


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
