"""Why a vehicle does not follow the setpoints that it gets: it is not armed, in another mode or in a failsafe."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from msggen.base.diagnostics import few
from msggen.check.finding import Change
from msggen.doctor.case import Case
from msggen.doctor.commands import misaddressed
from msggen.doctor.observation import SampleSeen, VehicleSeen
from msggen.doctor.setpoints import CONTROLS, Values, control, is_steered, means_inputs, setpoints
from msggen.messages.commands import ARM_DISARM, REFUSALS, SET_MODE, SET_NAV_STATE
from msggen.messages.names import uorb_name
from msggen.messages.nav_states import DISARMED, EXTERNAL, MODE_TITLES, OFFBOARD
from msggen.messages.refusals import ALWAYS, REQUIREMENTS
from msggen.messages.setpoints import KINDS

_SET_MODE = (SET_MODE, SET_NAV_STATE)
_REQUIRED: Mapping[str, str] = MappingProxyType({flag: f"mode_req_{name}" for name, (flag, _) in REQUIREMENTS.items()})
"""The flags of FailsafeFlags that count in some modes, and the field that tells in which ones."""
_CRITICAL = 2
"""The `battery_warning` from which on PX4 does not arm."""
_VALID = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")
_PLACED = frozenset(field for kind in KINDS if kind.is_placed for field in kind.selectors)
"""The fields of OffboardControlMode that need an estimate of the position."""


def find_no_position(case: Case) -> Iterator[Change]:
    """Find vehicles that are to fly to a position, and do not know theirs."""
    for vehicle in case.alive:
        problem = _unplaced(vehicle) if _needs_position(case, vehicle) else ""
        if problem:
            yield case.of(
                vehicle,
                f"has no estimate of its position ({problem}), which its setpoints need: wait for GPS or for visual "
                "odometry; `commander check` and `ekf2 status` in PX4's shell show what is missing",
            )


def _needs_position(case: Case, vehicle: VehicleSeen) -> bool:
    placed = set(setpoints(case, vehicle)) & {topic for name in _PLACED for topic in CONTROLS[name]}
    return control(case, vehicle) in _PLACED or bool(placed)


def _unplaced(vehicle: VehicleSeen) -> str:
    """Return what is missing of the position, "" if nothing is known to be missing."""
    position = vehicle.state("vehicle_local_position")
    invalid = [name for name in _VALID if position.get(name) is False]
    if invalid:
        return f"{few(invalid)} of vehicle_local_position {'is' if len(invalid) == 1 else 'are'} false"
    name = next((route.name for route in vehicle.routes if uorb_name(route.name) == "vehicle_local_position"), "")
    return f"'{name}' is not published" if name and name not in vehicle.topics else ""


def find_failsafe(case: Case) -> Iterator[Change]:
    """Find vehicles in a failsafe."""
    for vehicle in case.alive:
        status = vehicle.state("vehicle_status")
        if status.get("failsafe") and means_inputs(case, vehicle):
            yield case.of(
                vehicle,
                f"is in a failsafe, in mode {_mode(status)}{_why(vehicle)}, and follows no setpoints: end the cause, "
                "then select Offboard mode again",
            )


def _mode(status: Values) -> str:
    number = status.get("nav_state", -1)
    return MODE_TITLES.get(number, str(number))


def _why(vehicle: VehicleSeen) -> str:
    """Return the flags that forbid the mode, for people: ` because of x`."""
    flags = _failing(vehicle)
    return f" because of {few(flags)}" if flags else ""


def _failing(vehicle: VehicleSeen) -> list[str]:
    """Return the flags of FailsafeFlags that forbid the mode that the user has selected."""
    flags, status = vehicle.state("failsafe_flags"), vehicle.state("vehicle_status")
    bit = 1 << status.get("nav_state_user_intention", status.get("nav_state", OFFBOARD))
    found = [name for name, field in _REQUIRED.items() if flags.get(name) and flags.get(field, 0) & bit]
    found += [name for name in ALWAYS if flags.get(name)]
    warning = flags.get("battery_warning", 0)
    return [*found, *([f"battery_warning {warning}"] if warning >= _CRITICAL else ())]


def find_failing_checks(case: Case) -> Iterator[Change]:
    """Find vehicles that cannot be armed, and that nobody has told so yet."""
    for vehicle in _disarmed(case):
        if vehicle.state("vehicle_status").get("pre_flight_checks_pass") is False and not _refused(
            vehicle, (ARM_DISARM,)
        ):
            yield case.of(
                vehicle,
                f"is disarmed and cannot be armed: its checks fail in mode {_mode(vehicle.state('vehicle_status'))}"
                f"{_why(vehicle)}; `commander check` in PX4's shell, or a ground station, tells all reasons",
            )


def find_refused_arming(case: Case) -> Iterator[Change]:
    """Find vehicles that refuse to arm."""
    for vehicle in case.alive:
        status, refused = vehicle.state("vehicle_status"), _refused(vehicle, (ARM_DISARM,))
        if status.get("arming_state") == DISARMED and refused and means_inputs(case, vehicle):
            checks = "its checks pass now" if status.get("pre_flight_checks_pass", True) else "its checks fail"
            yield case.of(
                vehicle,
                f"has answered the command to arm with '{_result(refused)}' {_ago(case, refused)}, in mode "
                f"{_mode(status)}: {checks}{_why(vehicle)}; `commander check` in PX4's shell, or a ground station, "
                "tells all reasons",
            )


def find_not_armed(case: Case) -> Iterator[Change]:
    """Find vehicles that get setpoints, and could be armed."""
    for vehicle in _disarmed(case):
        passes = vehicle.state("vehicle_status").get("pre_flight_checks_pass", True)
        if passes and not _refused(vehicle, (ARM_DISARM,)) and not _is_misaddressed(case, vehicle, (ARM_DISARM,)):
            yield case.of(
                vehicle,
                f"gets setpoints, but is not armed: send VehicleCommand COMPONENT_ARM_DISARM ({ARM_DISARM}) with "
                "param1 = 1, `msggen command arm`",
            )


def find_refused_mode(case: Case) -> Iterator[Change]:
    """Find vehicles that refuse a mode."""
    for vehicle in case.alive:
        status, refused = vehicle.state("vehicle_status"), _refused(vehicle, _SET_MODE)
        if refused and status and not _follows(status) and means_inputs(case, vehicle):
            yield case.of(
                vehicle,
                f"has answered the command to change the mode with '{_result(refused)}' {_ago(case, refused)}, and is "
                f"in mode {_mode(status)}{_why(vehicle)}: for Offboard mode, publish offboard_control_mode for 1 s "
                "before, and have what its setpoint needs, such as a position",
            )


def find_other_mode(case: Case) -> Iterator[Change]:
    """Find vehicles that get setpoints in a mode that does not use them."""
    for vehicle in case.alive:
        status = vehicle.state("vehicle_status")
        is_other = bool(status) and not _follows(status) and not status.get("failsafe")
        is_told = _refused(vehicle, _SET_MODE) or _is_misaddressed(case, vehicle, _SET_MODE)
        if is_other and is_steered(case, vehicle) and not is_told:
            yield case.of(
                vehicle,
                f"gets setpoints, but is in mode {_mode(status)}, which does not use them: send VehicleCommand "
                f"DO_SET_MODE ({SET_MODE}) with param1 = 1 and param2 = 6, `msggen command mode offboard`",
            )


def _follows(status: Values) -> bool:
    """Whether a vehicle is in a mode that uses the setpoints of programs."""
    return status.get("nav_state") == OFFBOARD or status.get("nav_state") in EXTERNAL


def _disarmed(case: Case) -> Iterator[VehicleSeen]:
    """Yield the vehicles that get setpoints and are not armed."""
    for vehicle in case.alive:
        if is_steered(case, vehicle) and vehicle.state("vehicle_status").get("arming_state") == DISARMED:
            yield vehicle


def _refused(vehicle: VehicleSeen, commands: tuple[int, ...]) -> SampleSeen | None:
    """Return the last acknowledgement of some commands if it is a refusal."""
    found = [each for each in vehicle.kept("vehicle_command_ack") if each.values.get("command") in commands]
    return found[-1] if found and found[-1].values.get("result") in REFUSALS else None


def _is_misaddressed(case: Case, vehicle: VehicleSeen, commands: tuple[int, ...]) -> bool:
    """Whether a program has sent one of some commands, and to another vehicle."""
    return any(each.number in commands for each in misaddressed(case, vehicle))


def _result(refused: SampleSeen) -> str:
    return REFUSALS[refused.values["result"]]


def _ago(case: Case, refused: SampleSeen) -> str:
    return f"{(case.seen.now - refused.time) / 1e9:.1f} s ago"
