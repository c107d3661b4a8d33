"""The parts of a program that the vehicle registers, the topics that they need, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from inspect import iscoroutinefunction
from typing import Final, NamedTuple, get_args

from msggen.flight.checks import Check, Requirement
from msggen.flight.errors import RegistrationError
from msggen.flight.executor import Executor, Start
from msggen.flight.feeds import Connection, Topics
from msggen.flight.limits import Limits
from msggen.flight.link import Need
from msggen.flight.mode import Mode
from msggen.flight.places import Frame
from msggen.flight.registration import Keeps, Wanted
from msggen.messages.nav_states import EXTERNAL
from msggen.messages.setpoints import SENT, Kind

_ALWAYS: Final = (
    Need("in", "register_ext_component_request"),
    Need("out", "register_ext_component_reply"),
    Need("in", "unregister_ext_component"),
    Need("out", "arming_check_request"),
    Need("in", "arming_check_reply"),
    Need("in", "mode_completed"),
)
_CONFIGURATION: Final = (
    Need("in", "setpoint_config"),
    Need("out", "setpoint_config_reply"),
    Need("in", "config_control_setpoints"),
)
"""Needed as far as the release has them."""
_OF_EXECUTORS: Final = Need("in", "vehicle_command_mode_executor")
NEEDED: Final = (
    *_ALWAYS,
    *_CONFIGURATION,
    _OF_EXECUTORS,
    *(Need("in", topic) for kind in SENT for topic in kind.topics),
)
"""All topics that modes, executors and checks can need."""


class Part(NamedTuple):
    """A mode, and the executor that it belongs to, or a check."""

    subject: Mode | Check
    executor: Executor | None = None

    @property
    def wanted(self) -> Wanted:
        """The registration to request."""
        mode, executor = self.subject, self.executor
        if isinstance(mode, Check):
            return Wanted(mode.name, is_mode=False)
        return Wanted(
            mode.name,
            executor=executor is not None,
            replaces=mode.replaces,
            is_immediate=executor is not None and executor.starts == "registered",
            is_selectable=mode.is_selectable,
        )


def needed_topics(connection: Connection, parts: Sequence[Part]) -> Iterator[Need]:
    """Yield the topics that modes, executors and checks need."""
    topics = Topics(connection.package)
    yield from _ALWAYS
    yield from (each for each in _CONFIGURATION if topics.has(*each))
    modes = [part.subject for part in parts if isinstance(part.subject, Mode)]
    for topic in {topic for mode in modes for kind in mode.setpoints for topic in kind.topics}:
        yield Need("in", topic)
    if any(part.executor is not None for part in parts):
        yield _OF_EXECUTORS


def check_mode(mode: Mode, *, is_owned: bool) -> None:
    """Raise RegistrationError for a mode whose class is wrong, or which another flight has registered."""
    what = f"mode {mode.name!r}"
    if mode.is_registered:
        raise RegistrationError(f"{what} is registered already: each flight needs an object of its own")
    if not is_owned or type(mode).fly is not Mode.fly:
        _check_method(mode, Mode, "fly", what)
    _check_word(mode.frame, get_args(Frame), f"{what}: `frame`")
    _check_type(mode.requires, Requirement, f"{what}: `requires`", "LOCAL_POSITION")
    _check_type(mode.limits, Limits, f"{what}: `limits`", "Limits(height=20.0)")
    _check_type(mode.keeps, Keeps, f"{what}: `keeps`", "Keeps(armed=True)")
    if not (isinstance(mode.setpoints, tuple) and all(isinstance(each, Kind) for each in mode.setpoints)):
        raise RegistrationError(
            f"{what}: expected a tuple of kinds as `setpoints`, such as (GOTO,) or (FIXED_WING,), or ROVER as it is"
        )
    if mode.replaces is not None and mode.replaces not in range(EXTERNAL.start):
        raise RegistrationError(f"{what}: expected a nav_state of a PX4 mode as `replaces`, got {mode.replaces!r}")


def check_executor(executor: Executor) -> None:
    """Raise RegistrationError for an executor whose class is wrong, or which another flight has registered."""
    what = f"executor {type(executor).__name__}"
    if executor.is_registered:
        raise RegistrationError(f"{what} is registered already: each flight needs an object of its own")
    _check_method(executor, Executor, "run", what)
    _check_word(executor.starts, get_args(Start), f"{what}: `starts`")
    _check_type(executor.keeps, Keeps, f"{what}: `keeps`", "Keeps(armed=True)")
    if executor.mode.replaces is not None:
        raise RegistrationError(
            f"{executor.mode.name}: a mode that replaces a PX4 mode cannot have an executor, which is never in charge"
        )


def check_check(check: Check) -> None:
    """Raise RegistrationError for a check whose class is wrong, or which another flight has registered."""
    what = f"check {check.name!r}"
    if check.is_registered:
        raise RegistrationError(f"{what} is registered already: each flight needs an object of its own")
    method = type(check).problems
    if method is Check.problems or iscoroutinefunction(method):
        raise RegistrationError(f"{what} needs a method `def problems(self)`")


def _check_method(part: object, base: type, name: str, what: str) -> None:
    method = getattr(type(part), name)
    if method is getattr(base, name) or not iscoroutinefunction(method):
        raise RegistrationError(f"{what} needs a method `async def {name}(self)`")


def _check_type(value: object, kind: type, what: str, example: str) -> None:
    if not isinstance(value, kind):
        raise RegistrationError(f"{what}: expected {kind.__name__}, such as {example}, got {value!r}")


def _check_word(value: object, words: tuple[str, ...], what: str) -> None:
    if value not in words:
        raise RegistrationError(f"{what}: expected {' or '.join(map(repr, words))}, got {value!r}")
