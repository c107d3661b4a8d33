"""Flight modes, executors and actions in Python. See docs/flight.md."""

from __future__ import annotations

from msggen.flight.blocking import BlockingFlight
from msggen.flight.checks import Problem, Severity
from msggen.flight.errors import (
    FlightError,
    LimitError,
    NoAnswerError,
    NotReachedError,
    RefusedError,
    RegistrationError,
    RestartedError,
    UnsupportedError,
)
from msggen.flight.executor import Executor
from msggen.flight.flight import Flight
from msggen.flight.limits import Limits
from msggen.flight.mode import Mode
from msggen.flight.overrides import Deferral, Keeps
from msggen.flight.places import GlobalPlace
from msggen.flight.requirements import GLOBAL_POSITION, LOCAL_POSITION, Requirement
from msggen.flight.setpoints import ATTITUDE, GOTO, RATES, TRAJECTORY
from msggen.flight.space import Vector

__all__ = [
    "ATTITUDE",
    "GLOBAL_POSITION",
    "GOTO",
    "LOCAL_POSITION",
    "RATES",
    "TRAJECTORY",
    "BlockingFlight",
    "Deferral",
    "Executor",
    "Flight",
    "FlightError",
    "GlobalPlace",
    "Keeps",
    "LimitError",
    "Limits",
    "Mode",
    "NoAnswerError",
    "NotReachedError",
    "Problem",
    "RefusedError",
    "RegistrationError",
    "Requirement",
    "RestartedError",
    "Severity",
    "UnsupportedError",
    "Vector",
]
