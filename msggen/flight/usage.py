"""Errors of calls with wrong arguments: they show how the call is written, and name the nearest argument."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from types import MappingProxyType
from typing import Final, ParamSpec, TypeVar

from msggen.base.diagnostics import suggestion

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")

ON_EARTH: Final = (
    "expected a GlobalPlace or keywords: `{0}(GlobalPlace(47.4, 8.5, 500.0))` or "
    "`{0}(latitude=47.4, longitude=8.5, altitude=500.0)`, in degrees and in m above mean sea level"
)
"""How calls with a place on earth are written."""
LOCAL: Final = (
    "expected one place: `{0}((5.0, 0.0, -5.0))` in m in the local frame, or `{0}(GlobalPlace(47.4, 8.5, 500.0))`"
)
"""How calls with a place in the local frame are written."""
BY_NAME: Final = "expected keywords, such as `{0}(velocity=(1.0, 0.0, 0.0))`"
RATES: Final = "expected keywords: `{0}(roll=0.0, pitch=0.0, yaw=0.1, thrust=0.5)`, in rad/s and from 0 to 1"
ATTITUDE: Final = "expected `{0}((1.0, 0.0, 0.0, 0.0), thrust=0.5)`: a quaternion w, x, y, z, and from 0 to 1"
WINGS: Final = "expected keywords, such as `{0}(course_deg=90.0, altitude=520.0)`, in m above mean sea level"
DRIVING: Final = (
    "expected keywords, such as `{0}(speed=2.0, heading_deg=90.0)`, in m/s, or `{0}(throttle=0.3, steering=-0.5)`"
)
MOTORS: Final = "expected keywords, such as `{0}(motors=[0.5, 0.5, None], servos=[-1.0])`, from -1 to 1"
THRUSTS: Final = "expected keywords: `{0}(thrust=(0.0, 0.0, -0.5), torque=(0.0, 0.0, 0.0))`, in FRD, from -1 to 1"
MEASURED: Final = "expected keywords, such as `{0}(position=(1.0, 0.0, -2.0), variance=0.01, frame='ned')`"
LIMITS: Final = "expected keywords: `{0}(height=20.0, distance=50.0)`, in m"

ARGUMENTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "yaw": "`heading` in rad or `heading_deg`",
        "yaw_deg": "`heading_deg`",
        "yawspeed": "`turn_rate` in rad/s",
        "yaw_rate": "`turn_rate` in rad/s",
        "yaw_rate_setpoint": "`turn_rate` in rad/s",
        "yaw_setpoint": "`heading` in rad or `heading_deg`",
        "speed_body_x": "`speed` in m/s",
        "throttle_body_x": "`throttle`",
        "normalized_steering_setpoint": "`steering`",
        "equivalent_airspeed": "`airspeed` in m/s",
        "throttle_direct": "`throttle`",
        "lat": "`latitude`",
        "lon": "`longitude`",
        "alt": "`altitude`",
        "absolute_altitude_m": "`altitude` in m above mean sea level",
        "latitude_deg": "`latitude`",
        "longitude_deg": "`longitude`",
    }
)
"""Arguments of PX4's messages and of MAVSDK, and those of msggen."""


def named(function: str, usage: str) -> str:
    """Return the error of a call that is written as `usage` says."""
    return f"{function}: {usage.format(function)}"


def explained(usage: str) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """Return a decorator with which a call with wrong arguments raises a TypeError that shows how it is written.

    A right call costs nothing more than the call of the function that this returns.
    """

    def decorated(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        @wraps(function)
        def call(*arguments: _Parameters.args, **options: _Parameters.kwargs) -> _Result:
            try:
                return function(*arguments, **options)
            except TypeError as error:
                trace = error.__traceback__
                if trace is not None and trace.tb_next is not None:  # raised inside
                    raise
                raise TypeError(_problem(function, usage, options)) from None

        return call

    return decorated


def explained_class(usage: str) -> Callable[[type[_Result]], type[_Result]]:
    """Return the same for a class, whose name stands for that of the call."""

    def decorated(cls: type[_Result]) -> type[_Result]:
        cls.__init__ = explained(usage)(cls.__init__)  # type: ignore[method-assign]
        return cls

    return decorated


def _problem(function: Callable[..., object], usage: str, options: Mapping[str, object]) -> str:
    known = inspect.signature(function).parameters
    name = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]
    wrong = next((each for each in options if each not in known), None)
    if wrong is None:
        return named(name, usage)
    near = f": it is {ARGUMENTS[wrong]}" if _is_counterpart(wrong, known) else suggestion(wrong, known)
    return f"{name} has no argument {wrong!r}{near or f': it takes {_listed(known)}'}"


def _is_counterpart(wrong: str, known: Mapping[str, object]) -> bool:
    """Whether a call has the argument that the table names for a wrong one."""
    return any(f"`{each}`" in ARGUMENTS.get(wrong, "") for each in known)


def _listed(known: Mapping[str, object]) -> str:
    return ", ".join(each for each in known if each != "self")
