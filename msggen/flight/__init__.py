"""Flight modes, executors and actions in Python. See docs/flight.md."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from msggen.flight.blocking import BlockingFlight
from msggen.flight.checks import GLOBAL_POSITION, LOCAL_POSITION, Check, Health, Problem, Requirement, Severity
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
from msggen.flight.measurements import Fusion, NotFusedError
from msggen.flight.mode import Mode
from msggen.flight.places import GlobalPlace, Vector
from msggen.flight.registration import Deferral, Keeps
from msggen.messages.events import Component
from msggen.messages.setpoints import (
    ACTUATORS,
    ATTITUDE,
    FIXED_WING,
    GOTO,
    RATES,
    ROVER,
    ROVER_POSITION,
    ROVER_THROTTLE,
    THRUST_AND_TORQUE,
    TRAJECTORY,
)

__all__ = [
    "ACTUATORS",
    "ATTITUDE",
    "FIXED_WING",
    "GLOBAL_POSITION",
    "GOTO",
    "LOCAL_POSITION",
    "RATES",
    "ROVER",
    "ROVER_POSITION",
    "ROVER_THROTTLE",
    "THRUST_AND_TORQUE",
    "TRAJECTORY",
    "BlockingFlight",
    "Check",
    "Component",
    "Deferral",
    "Executor",
    "Flight",
    "FlightError",
    "Fusion",
    "GlobalPlace",
    "Health",
    "Keeps",
    "LimitError",
    "Limits",
    "Mode",
    "NoAnswerError",
    "NotFusedError",
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

if not TYPE_CHECKING:  # type checkers would accept every name

    def __getattr__(name: str) -> object:
        """Raise AttributeError, or ImportError to `import`. It tells the name of msggen for that of another library."""
        from msggen.flight.usage import IMPORTED, is_import, told

        text = told(f"module {__name__!r}", name, __all__, IMPORTED)
        if name in IMPORTED and is_import(sys._getframe(1)):  # noqa: SLF001 - nothing else tells it
            raise ImportError(text, name=name)  # `from ... import` replaces the text of an AttributeError
        raise AttributeError(text, name=name, obj=None)

    def __dir__() -> list[str]:
        """Return the public names."""
        return [*__all__]
