"""The names that px4-ros2-interface-lib and MAVSDK give to things of flights, and those of msggen, for errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dis import opmap
from types import FrameType, MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from msggen.base.diagnostics import suggestion

_ACTIONS = "a method of the flight: `await flight.arm()`"
_OFFBOARD = "`async with flight.offboard() as setpoint`"
_VELOCITY = "`setpoint.trajectory(velocity=...)`"
_TELEMETRY = "`flight.telemetry`"
_SETPOINT = "a method of Mode: `self.trajectory(...)`"

IMPORTED: Final[Mapping[str, str]] = MappingProxyType(
    {
        "System": "`Flight`",
        "NodeWithMode": "`Flight`",
        "NodeWithModeExecutor": "`Flight`",
        "ModeBase": "`Mode`",
        "ModeExecutorBase": "`Executor`",
        "Settings": "attributes of a Mode: `name`, `replaces`, `is_selectable`, `flies_disarmed`",
        "MulticopterGotoSetpointType": "a method of Mode: `await self.goto(...)`",
        "MulticopterGotoGlobalSetpointType": "a method of Mode: `await self.goto(GlobalPlace(...))`",
        "TrajectorySetpointType": _SETPOINT,
        "AttitudeSetpointType": "a method of Mode: `self.attitude(...)`",
        "RatesSetpointType": "a method of Mode: `self.rates(...)`",
        "OdometryLocalPosition": _TELEMETRY,
        "OdometryGlobalPosition": _TELEMETRY,
        "OdometryAttitude": _TELEMETRY,
        "Battery": _TELEMETRY,
        "LandDetected": _TELEMETRY,
        "HomePositionSetter": "`flight.set_home`, `flight.set_origin`",
        "RequirementFlags": "`Requirement`",
        "MissionExecutor": "`Mission` of msggen.flight.missions",
        "ActionInterface": "`Action` of msggen.flight.missions",
        "Mission": "`Mission` of msggen.flight.missions",
        "PositionNedYaw": _OFFBOARD,
        "VelocityNedYaw": _OFFBOARD,
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
        "scheduleMode": "`await self.fly(mode)`",
        "waitUntilDisarmed": "`await self.wait_disarmed()`",
        "waitReadyToArm": "`await self.arm()`, which raises RefusedError with the reasons",
        "doRegister": "`await flight.add(mode)`",
        "update": "`goto`, `trajectory`, `attitude`, `rates`",
        # MAVSDK
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
        "health": "`arm`, which raises RefusedError with the reasons",
        "connect": "`async with Flight(address) as flight`",
        "core": "`async with Flight(address) as flight`",
        "mission": "`Mission.load` of msggen.flight.missions for mission files; PX4's own missions go over MAVLink",
        "param": "parameters go over MAVLink, which msggen does not use",
        "camera": "cameras go over MAVLink, which msggen does not use",
    }
)
"""What programs call elsewhere. Each name is tried only where msggen has none like it."""


def told(owner: str, name: str, known: Iterable[str], counterparts: Mapping[str, str] = ATTRIBUTES) -> str:
    """Return the error of a name that `owner` does not have, with its counterpart or the nearest name in `known`."""
    meant = counterparts.get(name) or counterparts.get(_camel(name))
    if meant is not None:
        return f"{owner} has no {name!r}: in msggen, it is {meant}"
    return f"{owner} has no {name!r}{suggestion(name, [each for each in known if not each.startswith('_')])}"


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
