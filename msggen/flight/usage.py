"""Errors of calls and names that are wrong: they show how a call is written, and name the nearest argument or name.

Some names are those of px4-ros2-interface-lib and MAVSDK: the error tells what msggen calls it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Container, Iterable, Mapping
from dis import opmap
from functools import wraps
from types import FrameType, MappingProxyType
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

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
        **dict.fromkeys(("yaw", "yaw_setpoint"), "`heading` in rad or `heading_deg`"),
        "yaw_deg": "`heading_deg`",
        **dict.fromkeys(("yawspeed", "yaw_rate", "yaw_rate_setpoint"), "`turn_rate` in rad/s"),
        "speed_body_x": "`speed` in m/s",
        **dict.fromkeys(("throttle_body_x", "throttle_direct"), "`throttle`"),
        "normalized_steering_setpoint": "`steering`",
        "equivalent_airspeed": "`airspeed` in m/s",
        **dict.fromkeys(("lat", "latitude_deg"), "`latitude`"),
        **dict.fromkeys(("lon", "longitude_deg"), "`longitude`"),
        "alt": "`altitude`",
        "absolute_altitude_m": "`altitude` in m above mean sea level",
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


_CONNECTED = "`async with Flight(address) as flight`"
_ACTIONS = "a method of the flight: `await flight.arm()`"
_OFFBOARD = "`async with flight.offboard() as setpoint`"
_VELOCITY = "`setpoint.trajectory(velocity=...)`"
_REASONS = "`arm`, which raises RefusedError with the reasons"
_TELEMETRY = "`flight.telemetry`"
_SETPOINT = "a method of Mode: `self.trajectory(...)`"

IMPORTED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ModeBase": "`Mode`",
        **dict.fromkeys(("NodeWithMode", "NodeWithModeExecutor", "System"), "`Flight`"),
        "ModeExecutorBase": "`Executor`",
        "HealthAndArmingChecks": "`Check`",
        "HealthAndArmingCheckReporter": "the `problems` and the `health` that a Mode or a Check returns",
        "Settings": "attributes of a Mode: `name`, `replaces`, `is_selectable`, `flies_disarmed`",
        "MulticopterGotoSetpointType": "a method of Mode: `await self.goto(...)`",
        "MulticopterGotoGlobalSetpointType": "a method of Mode: `await self.goto(GlobalPlace(...))`",
        "TrajectorySetpointType": _SETPOINT,
        "AttitudeSetpointType": "a method of Mode: `self.attitude(...)`",
        "RatesSetpointType": "a method of Mode: `self.rates(...)`",
        "FwLateralLongitudinalSetpointType": "a method of Mode: `self.fixed_wing(...)`",
        "RoverPositionSetpointType": "a method of Mode: `await self.goto(...)`",
        **dict.fromkeys(
            (
                f"Rover{speed}{turn}SetpointType"
                for speed in ("Speed", "Throttle")
                for turn in ("Attitude", "Rate", "Steering")
            ),
            "a method of Mode: `self.rover(...)`",
        ),
        "DirectActuatorsSetpointType": "a method of Mode: `self.actuators(...)`",
        "PeripheralActuatorControls": "`flight.set_actuators(...)`",
        "VTOL": "methods of Mode: `await self.to_fixed_wing()`, `await self.to_multicopter()`",
        "OdometryLocalPosition": _TELEMETRY,
        "OdometryGlobalPosition": _TELEMETRY,
        "OdometryAttitude": _TELEMETRY,
        "Battery": _TELEMETRY,
        "LandDetected": _TELEMETRY,
        "TelemetryAsync": _TELEMETRY,
        "OdometryAirspeed": f"{_TELEMETRY}: `await airspeed()`",
        "ManualControlInput": f"{_TELEMETRY}: `await sticks()`",
        "VtolStatus": f"{_TELEMETRY}: `await vtol()`",
        "LocalPositionMeasurementInterface": "`flight.measure.local(...)`",
        "GlobalPositionMeasurementInterface": "`flight.measure.on_earth(...)`",
        "HomePositionSetter": "`flight.set_home`, `flight.set_origin`",
        "RequirementFlags": "`Requirement`",
        **dict.fromkeys(("Mavsdk", "Configuration", "ComponentType"), _CONNECTED),
        "Action": f"`BlockingFlight`, and {_ACTIONS}",
        "ActionAsync": _ACTIONS,
        "Telemetry": f"`BlockingFlight`, and {_TELEMETRY}",
        "Offboard": f"`BlockingFlight`, and {_OFFBOARD}",
        "OffboardAsync": _OFFBOARD,
        "PositionNedYaw": _OFFBOARD,
        "PositionGlobalYaw": _OFFBOARD,
        "VelocityNedYaw": _OFFBOARD,
        "VelocityBodyYawspeed": _OFFBOARD,
        "AccelerationNed": _OFFBOARD,
        **dict.fromkeys(("MissionExecutor", "Mission"), "`Mission` of msggen.flight.missions"),
        "ActionInterface": "`Action` of msggen.flight.missions",
        **dict.fromkeys(("MavsdkError", "MavsdkConnectionError", "OffboardError", "ActionError"), "`FlightError`"),
    }
)
"""What programs import elsewhere."""
ATTRIBUTES: Final[Mapping[str, str]] = MappingProxyType(
    {
        # px4-ros2-interface-lib
        "onActivate": "the start of `fly`",
        "updateSetpoint": "the loop in `fly`",
        "onDeactivate": "the cancellation of `fly`",
        "completed": "the end of `fly`: `return`, or an exception",
        "setSetpointUpdateRate": "the rate of the kind of setpoint",
        "modeRequirements": "`requires`",
        "checkArmingAndRunConditions": "`problems`",
        "armingCheckFailureExt": "a Problem that `problems` returns",
        "setHealth": "the Health that `health` returns",
        "scheduleMode": "`await self.fly(mode)`",
        "waitUntilDisarmed": "`await self.wait_disarmed()`",
        "waitReadyToArm": "`await self.arm()`, which raises RefusedError with the reasons",
        "doRegister": "`await flight.add(mode)`",
        "update": "`goto`, `trajectory`, `attitude`, `rates`",
        # MAVSDK
        **dict.fromkeys(("toFixedwing", "transition_to_fixedwing"), "`to_fixed_wing`"),
        **dict.fromkeys(("toMulticopter", "transition_to_multicopter"), "`to_multicopter`"),
        "set_actuator": "`set_actuators`",
        **dict.fromkeys(("action", "arm", "takeoff", "land", "hold"), _ACTIONS),
        **dict.fromkeys(("rtl", "return_to_launch"), "`return_home` of the flight"),
        "return_home": "`rtl` of the executor",
        "goto_location": "`goto(latitude=..., longitude=..., altitude=...)`",
        "set_takeoff_altitude": "`takeoff(altitude)`",
        "start": _OFFBOARD,
        "stop": "the end of that block",
        "set_position_ned": "`await setpoint.goto(...)`",
        "set_velocity_ned": _VELOCITY,
        "set_velocity_body": f"{_VELOCITY}, in NED or ENU",
        "set_position_global": "`await setpoint.goto(GlobalPlace(...))`",
        "set_acceleration_ned": "`setpoint.trajectory(acceleration=...)`",
        "set_position_velocity_ned": "`setpoint.trajectory(position=..., velocity=...)`",
        "set_position_velocity_acceleration_ned": "`setpoint.trajectory(position=..., velocity=..., acceleration=...)`",
        "set_attitude": "`self.attitude(...)` in a Mode",
        "set_attitude_rate": "`self.rates(...)` in a Mode",
        "position": "`await global_position()` or `await local_position()`",
        **dict.fromkeys(("position_velocity_ned", "velocity_ned"), "`await local_position()`"),
        **dict.fromkeys(("attitude_euler", "attitude_quaternion"), "`await attitude()`"),
        **dict.fromkeys(("in_air", "landed_state"), "`await land()`, whose `is_landed` tells"),
        "armed": "`is_armed` of the flight",
        "flight_mode": "`mode` of the flight",
        **dict.fromkeys(("health", "health_all_ok"), _REASONS),
        "rc_status": "`await sticks()`",
        "fixedwing_metrics": "`await airspeed()`",
        "vtol_state": "`await vtol()`",
        "set_gps_global_origin": "`set_origin(latitude=..., longitude=..., altitude=...)`",
        **dict.fromkeys(("connect", "core", "add_any_connection", "first_autopilot", "on_new_system"), _CONNECTED),
        "mission": "`Mission.load` of msggen.flight.missions for mission files; PX4's own missions go over MAVLink",
        "param": "parameters go over MAVLink, which msggen does not use",
        "mocap": "`flight.measure`",
        **dict.fromkeys(("set_vision_position_estimate", "set_odometry"), "`flight.measure.local(...)`"),
        "camera": "cameras go over MAVLink, which msggen does not use",
    }
)
"""What programs call elsewhere. Each name is tried only where msggen has none like it."""


def told(owner: str, name: str, known: Iterable[str], counterparts: Mapping[str, str] = ATTRIBUTES) -> str:
    """Return the error of a name that `owner` does not have, with its counterpart or the nearest name in `known`."""
    known = {*known}
    meant = counterparts.get(name) or counterparts.get(_camel(name)) or _of_mavsdk(name, known)
    if meant is not None:
        return f"{owner} has no {name!r}: in msggen, it is {meant}"
    return f"{owner} has no {name!r}{suggestion(name, [each for each in known if not each.startswith('_')])}"


def _of_mavsdk(name: str, known: Container[str]) -> str | None:
    """Return what a method is that MAVSDK 4 makes of another one: `subscribe_battery`, and `arm_async` of `arm`."""
    if name.startswith("subscribe_"):
        return "a function that is called for each message: `flight.feeds[topic].call(function)`"
    plain = name.removesuffix("_async")
    return f"`await {plain}(...)`" if plain != name and plain in known else None


def is_import(frame: FrameType) -> bool:
    """Whether a frame executes `from ... import` just now, and not `hasattr` or an attribute."""
    return frame.f_code.co_code[frame.f_lasti] == opmap["IMPORT_FROM"]


def _camel(name: str) -> str:
    """Return a name as the C++ library spells it: `schedule_mode` is `scheduleMode`, as in its Python bindings."""
    first, *others = name.split("_")
    return first + "".join(each.title() for each in others)


class Hinted:
    """Objects whose missing attributes are told with the nearest name, or with that of another library."""

    if not TYPE_CHECKING:  # type checkers would accept every name

        def __getattr__(self, name: str) -> Any:
            """Raise AttributeError, which tells what is meant."""
            cls = type(self)
            text = told(cls.__name__, name, {*dir(cls), *vars(self)})
            raise AttributeError(text, name=name, obj=None)  # without obj, Python adds no suggestion of its own
