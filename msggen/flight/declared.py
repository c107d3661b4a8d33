"""Checks of what modes and executors declare, before anything is sent."""

from __future__ import annotations

from inspect import iscoroutinefunction
from typing import get_args

from msggen.flight.answering import Check
from msggen.flight.errors import RegistrationError
from msggen.flight.executor import Executor, Start
from msggen.flight.limits import Limits
from msggen.flight.mode import Mode
from msggen.flight.overrides import Keeps
from msggen.flight.requirements import Requirement
from msggen.flight.space import Frame
from msggen.messages.nav_states import EXTERNAL
from msggen.messages.setpoints import Kind


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
