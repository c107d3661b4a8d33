"""The names that px4-ros2-interface-lib and MAVSDK give to things of flights, and those of msggen, for errors."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dis import opmap
from types import FrameType, MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from msggen.base.diagnostics import suggestion

_CONNECTED = "`async with Flight(address) as flight`"
_ACTIONS = "a method of the flight: `await flight.arm()`"
_OFFBOARD = "`async with flight.offboard() as setpoint`"
_VELOCITY = "`setpoint.trajectory(velocity=...)`"
_REASONS = "`arm`, which raises RefusedError with the reasons"
_TELEMETRY = "`flight.telemetry`"
_SETPOINT = "a method of Mode: `self.trajectory(...)`"

IMPORTED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "System": "`Flight`",
        "NodeWithMode": "`Flight`",
        "NodeWithModeExecutor": "`Flight`",
        "ModeBase": "`Mode`",
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
        "OdometryAirspeed": f"{_TELEMETRY}: `await airspeed()`",
        "ManualControlInput": f"{_TELEMETRY}: `await sticks()`",
        "VtolStatus": f"{_TELEMETRY}: `await vtol()`",
        "Battery": _TELEMETRY,
        "LandDetected": _TELEMETRY,
        "LocalPositionMeasurementInterface": "`flight.measure.local(...)`",
        "GlobalPositionMeasurementInterface": "`flight.measure.on_earth(...)`",
        "HomePositionSetter": "`flight.set_home`, `flight.set_origin`",
        "RequirementFlags": "`Requirement`",
        "Mavsdk": _CONNECTED,
        "Configuration": _CONNECTED,
        "ComponentType": _CONNECTED,
        "Action": f"`BlockingFlight`, and {_ACTIONS}",
        "ActionAsync": _ACTIONS,
        "Telemetry": f"`BlockingFlight`, and {_TELEMETRY}",
        "TelemetryAsync": _TELEMETRY,
        "Offboard": f"`BlockingFlight`, and {_OFFBOARD}",
        "OffboardAsync": _OFFBOARD,
        "MissionExecutor": "`Mission` of msggen.flight.missions",
        "ActionInterface": "`Action` of msggen.flight.missions",
        "Mission": "`Mission` of msggen.flight.missions",
        "PositionNedYaw": _OFFBOARD,
        "PositionGlobalYaw": _OFFBOARD,
        "VelocityNedYaw": _OFFBOARD,
        "VelocityBodyYawspeed": _OFFBOARD,
        "AccelerationNed": _OFFBOARD,
        "MavsdkError": "`FlightError`",
        "MavsdkConnectionError": "`FlightError`",
        "OffboardError": "`FlightError`",
        "ActionError": "`FlightError`",
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
        "toFixedwing": "`to_fixed_wing`",
        "toMulticopter": "`to_multicopter`",
        "transition_to_fixedwing": "`to_fixed_wing`",
        "transition_to_multicopter": "`to_multicopter`",
        "set_actuator": "`set_actuators`",
        "action": _ACTIONS,
        "rtl": "`return_home` of the flight",
        "return_home": "`rtl` of the executor",
        "return_to_launch": "`return_home` of the flight",
        "goto_location": "`goto(latitude=..., longitude=..., altitude=...)`",
        "set_takeoff_altitude": "`takeoff(altitude)`",
        "arm": _ACTIONS,
        "takeoff": _ACTIONS,
        "land": _ACTIONS,
        "hold": _ACTIONS,
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
        "position_velocity_ned": "`await local_position()`",
        "attitude_euler": "`await attitude()`",
        "attitude_quaternion": "`await attitude()`",
        "in_air": "`await land()`, whose `is_landed` tells",
        "landed_state": "`await land()`, whose `is_landed` tells",
        "armed": "`is_armed` of the flight",
        "flight_mode": "`mode` of the flight",
        "health": _REASONS,
        "health_all_ok": _REASONS,
        "velocity_ned": "`await local_position()`",
        "rc_status": "`await sticks()`",
        "fixedwing_metrics": "`await airspeed()`",
        "vtol_state": "`await vtol()`",
        "set_gps_global_origin": "`set_origin(latitude=..., longitude=..., altitude=...)`",
        "connect": _CONNECTED,
        "core": _CONNECTED,
        "add_any_connection": _CONNECTED,
        "first_autopilot": _CONNECTED,
        "on_new_system": _CONNECTED,
        "mission": "`Mission.load` of msggen.flight.missions for mission files; PX4's own missions go over MAVLink",
        "param": "parameters go over MAVLink, which msggen does not use",
        "mocap": "`flight.measure`",
        "set_vision_position_estimate": "`flight.measure.local(...)`",
        "set_odometry": "`flight.measure.local(...)`",
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
