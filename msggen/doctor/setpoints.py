"""What programs send to a vehicle: whether it arrives, and whether PX4 can follow it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from msggen.base.diagnostics import few
from msggen.check.finding import Change
from msggen.doctor.case import Case, matches
from msggen.doctor.observation import InputSeen, VehicleSeen
from msggen.link.link import Route
from msggen.messages.names import uorb_name
from msggen.messages.setpoints import KINDS, SELECTORS, TRAJECTORY
from msggen.messages.setpoints import OFFBOARD_CONTROL_MODE as MODE
from msggen.messages.vehicle_types import ROTARY_WING

Values: TypeAlias = Mapping[str, Any]

CONTROLS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {field: tuple(topic for kind in KINDS if field in kind.selectors for topic in kind.topics) for field in SELECTORS}
)
"""The fields of OffboardControlMode, and the topics of their setpoints. PX4 takes the first field that is set."""
SETPOINTS = tuple(topic for kind in KINDS if kind.selectors for topic in kind.topics)
_OTHER_SETPOINTS = ("rover_", "fixed_wing_")
"""The starts of the names of setpoints whose choice depends on the type of the vehicle."""
_EXTERNAL = "arming_check_reply"
"""The topic of programs that add a mode to PX4: such a mode needs no OffboardControlMode."""
_LONGEST = 1.0
"""The default of COM_OF_LOSS_T in s: Offboard mode ends after this time without an OffboardControlMode."""
_LEAST = 1.95
"""The rate in Hz below which 2 Hz are not reached."""
_OLD = 1.0
"""The age of a setpoint in s that is reported."""
_BELOW = 0.5
"""How far in m below the origin, and below the vehicle, a position is reported."""
_AXES = "xyz"


class Sent(NamedTuple):
    """What programs send to a topic of a vehicle while it is watched."""

    route: Route
    seen: InputSeen

    @property
    def senders(self) -> str:
        """The programs, for people."""
        return few([str(each) for each in self.seen.programs if each.samples]) or "an unknown program"

    def change(self, case: Case, text: str) -> Change:
        """Return a finding about what is sent."""
        return case.change(self.route.name, f"'{self.route.name}' from {self.senders} {text}")

    @property
    def values(self) -> Values:
        """The values of the newest sample, empty if they are not known."""
        return self.seen.last[-1].values if self.seen.last else {}


def sent(case: Case, vehicle: VehicleSeen) -> dict[str, Sent]:
    """Return what programs send to a vehicle, by the names of uORB topics. Nothing if the user means other topics."""
    if not means_inputs(case, vehicle):
        return {}
    routes = {route.name: route for route in vehicle.routes}
    return {
        uorb_name(name): Sent(routes[name], seen)
        for name, seen in vehicle.inputs.items()
        if name in routes and seen.samples
    }


def means_inputs(case: Case, vehicle: VehicleSeen) -> bool:
    """Whether the user means topics that the vehicle reads."""
    return not case.wanted or any(route.direction == "in" for route in case.routes(vehicle))


def setpoints(case: Case, vehicle: VehicleSeen) -> dict[str, Sent]:
    """Return the setpoints that programs send to a vehicle."""
    return {name: each for name, each in sent(case, vehicle).items() if _is_setpoint(name)}


def _is_setpoint(name: str) -> bool:
    return name in SETPOINTS or name.startswith(_OTHER_SETPOINTS)


def is_steered(case: Case, vehicle: VehicleSeen) -> bool:
    """Whether programs send setpoints to a vehicle, or say that they do."""
    return any(name == MODE or _is_setpoint(name) for name in sent(case, vehicle))


def control(case: Case, vehicle: VehicleSeen) -> str:
    """Return the field of OffboardControlMode that PX4 takes, "" if it is not known or none is set."""
    mode = sent(case, vehicle).get(MODE)
    return next((name for name in CONTROLS if mode is not None and mode.values.get(name)), "")


def find_unpublished(case: Case) -> Iterator[Change]:
    """Find topics that the user has named, that the vehicle reads and that nobody publishes."""
    for vehicle in case.alive if case.seen.hears_programs else ():
        for route in case.routes(vehicle) if case.wanted else ():
            seen = vehicle.inputs.get(route.name, InputSeen())
            if route.direction == "in" and not seen.samples:
                yield case.change(
                    route.name,
                    f"no program has published '{route.name}' in {case.seen.seconds:.1f} s{_earlier(case, seen)}: "
                    "start the program, or let it use the same link",
                )


def _earlier(case: Case, seen: InputSeen) -> str:
    """Return when the last sample came."""
    if not seen.last:
        return ""
    whose = f" from {few(list(map(str, seen.programs)))}" if seen.programs else ""
    return f", the last sample came {(case.seen.now - seen.last[-1].time) / 1e9:.1f} s ago{whose}"


def find_unreadable(case: Case) -> Iterator[Change]:
    """Find samples that the vehicle does not accept, and writers whose type nobody reads."""
    for vehicle in case.alive:
        for each in sent(case, vehicle).values():
            if each.seen.last and (problem := each.seen.last[-1].problem):
                cure = "build the program with the definitions of the vehicle's firmware"
                yield each.change(case, f"is not accepted: {problem}; {cure}")
    for name, dds_type, readers in case.seen.writers:
        if readers and dds_type not in readers and _is_meant(case, name):
            yield case.change(
                name,
                f"a writer in DDS publishes '{name}' as {dds_type}, and the vehicle reads {few(list(readers))}: use "
                "the message of the topic",
            )


def _is_meant(case: Case, name: str) -> bool:
    return not case.wanted or any(matches(wanted, Route(name, "", "in", -1)) for wanted in case.wanted)


def find_no_mode(case: Case) -> Iterator[Change]:
    """Find setpoints without OffboardControlMode."""
    for vehicle in case.alive:
        found = setpoints(case, vehicle)
        if found and not sent(case, vehicle).keys() & {MODE, _EXTERNAL}:
            first, each = next(iter(found.items()))
            past = next((seen for name, seen in vehicle.inputs.items() if name.endswith(f"/{MODE}")), InputSeen())
            yield case.of(
                vehicle,
                f"gets {first} from {each.senders} at {each.seen.rate:.1f} Hz, but no {MODE}{_earlier(case, past)}: "
                "publish it at 10 Hz, beginning 1 s before the change to Offboard mode",
            )


def find_slow_mode(case: Case) -> Iterator[Change]:
    """Find OffboardControlMode that comes too rarely."""
    for vehicle in case.alive:
        mode = sent(case, vehicle).get(MODE)
        if mode is not None and (mode.seen.longest > _LONGEST or 0 < mode.seen.rate < _LEAST):
            yield case.change(
                mode.route.name,
                f"'{mode.route.name}' comes from {mode.senders} at {mode.seen.rate:.1f} Hz, with up to "
                f"{mode.seen.longest:.1f} s between two: PX4 needs 2 Hz, and leaves Offboard mode after {_LONGEST:g} s "
                "without one (COM_OF_LOSS_T); publish it at 10 Hz from a timer of its own",
            )


def find_old(case: Case) -> Iterator[Change]:
    """Find setpoints whose timestamps are too old."""
    for vehicle in case.alive:
        for name, each in sent(case, vehicle).items():
            age = each.seen.age
            if (name == MODE or _is_setpoint(name)) and age is not None and age > _OLD and case.has_utc(vehicle):
                yield case.change(
                    each.route.name,
                    f"the timestamps of '{each.route.name}' from {each.senders} are {age:,.1f} s old, so PX4 takes "
                    "them for outdated: set `timestamp` to 0, or to the time of this computer in us",
                )


def find_unselected(case: Case) -> Iterator[Change]:
    """Find setpoints that OffboardControlMode does not select."""
    for vehicle in case.alive:
        mode = sent(case, vehicle).get(MODE)
        if mode is None or not mode.values:
            continue
        selected, found = control(case, vehicle), setpoints(case, vehicle)
        names = few([f"'{each.route.name}'" for each in found.values()]) or "no setpoints"
        if not selected:
            yield case.change(
                mode.route.name,
                f"'{mode.route.name}' from {mode.senders} selects nothing, because all its fields are false, and "
                f"programs publish {names}: set the field of the setpoint, such as `position` for trajectory_setpoint",
            )
        elif not _has_setpoint(vehicle, selected):
            yield case.change(
                mode.route.name,
                f"'{mode.route.name}' from {mode.senders} selects {selected}, which is set by "
                f"{few(list(CONTROLS[selected]))}, but programs publish {names}: publish that setpoint, or set the "
                "field of the one that is published, and no field before it",
            )


def _has_setpoint(vehicle: VehicleSeen, selected: str) -> bool:
    """Whether a setpoint of a control has ever been published: one is enough for PX4."""
    names = {uorb_name(route.name) for route in vehicle.routes if route.name in vehicle.inputs}
    return any(name in CONTROLS[selected] or name.startswith(_OTHER_SETPOINTS) for name in names)


def find_empty(case: Case) -> Iterator[Change]:
    """Find setpoints that control nothing, because they are not numbers."""
    for vehicle in case.alive:
        for each in setpoints(case, vehicle).values():
            problem = _uncontrolled(each.values)
            if problem:
                yield each.change(case, problem)


def _uncontrolled(values: Values) -> str:
    """Return what a setpoint leaves open, and what to do, or ""."""
    return next((problem for field, find in _OPEN.items() if field in values and (problem := find(values))), "")


def _open_position(values: Values) -> str:
    if "velocity" in values:
        return _open_axes(values)
    return "" if _is_finite(values.get("position", ())) else "has NaN in `position`: set all three axes"


def _open_attitude(values: Values) -> str:
    q = values.get("q_d", (1.0,))
    if _is_finite(q) and any(q):
        return ""
    return f"has no attitude, because `q_d` is {tuple(q)}: set a unit quaternion, w first"


def _open_rates(values: Values) -> str:
    rates = [values.get(axis, 0.0) for axis in ("roll", "pitch", "yaw")]
    return "" if _is_finite(rates) else "has NaN in `roll`, `pitch` or `yaw`: set all three rates"


def _open_thrust(values: Values) -> str:
    if _is_finite(values.get("thrust_body", ())):
        return ""
    return "has NaN in `thrust_body`: set the thrust, for a multicopter `thrust_body[2]` from -1 to 0"


def _open_actuators(values: Values) -> str:
    is_open = all(map(math.isnan, values.get("control", (0.0,))))
    return "has NaN for every actuator, which stops it: set values from -1 to 1" if is_open else ""


def _open_vector(values: Values) -> str:
    return "" if _is_finite(values.get("xyz", ())) else "has NaN in `xyz`: set all three axes"


def _open_axes(values: Values) -> str:
    """Return the axes that neither position nor velocity nor acceleration controls, and what to do, or ""."""
    kinds = [values[name] for name in TRAJECTORY.selectors if name in values]
    axes = [axis for index, axis in enumerate(_AXES) if not any(math.isfinite(kind[index]) for kind in kinds)]
    if not axes:
        return ""
    where = "on every axis" if len(axes) == len(_AXES) else f"for {few(axes)}"
    return (
        f"has NaN {where}, in position, velocity and acceleration: PX4 needs a number on each axis in one of them, and "
        "does not fly to a setpoint without it"
    )


def _is_finite(values: Sequence[float]) -> bool:
    return all(map(math.isfinite, values))


_OPEN: Mapping[str, Callable[[Values], str]] = MappingProxyType(
    {
        "position": _open_position,
        "q_d": _open_attitude,
        "roll": _open_rates,
        "thrust_body": _open_thrust,
        "xyz": _open_vector,
        "control": _open_actuators,
    }
)
"""The functions that find what a setpoint leaves open, by a field that it has."""


def find_contested(case: Case) -> Iterator[Change]:
    """Find programs that publish to the same setpoint."""
    for vehicle in case.alive:
        for name, each in sent(case, vehicle).items():
            programs = [program for program in each.seen.programs if program.samples]
            if len(programs) > 1 and (name == MODE or _is_setpoint(name)):
                rates = few([f"{program} at {program.rate:.1f} Hz" for program in programs])
                yield case.change(
                    each.route.name,
                    f"{len(programs)} programs publish '{each.route.name}' ({rates}), and PX4 takes the samples of "
                    "all: end all but one",
                )


def find_downward(case: Case) -> Iterator[Change]:
    """Find setpoints that mean up and point down, because z is positive downward."""
    for vehicle in case.alive:
        found = setpoints(case, vehicle)
        for each, problem in _downward(found.values(), vehicle):
            yield each.change(case, problem)


def _downward(found: Iterable[Sent], vehicle: VehicleSeen) -> Iterator[tuple[Sent, str]]:
    """Yield the setpoints that point down, and what to do."""
    height = vehicle.state("vehicle_local_position").get("z", 0.0)
    is_landed = vehicle.state("vehicle_land_detected").get("landed", False)
    for each in found:
        z, speed = (each.values.get(field, (math.nan,) * 3)[2] for field in ("position", "velocity"))
        thrust = each.values.get("thrust_body", (0.0,) * 3)[2]
        if z > max(0.0, height) + _BELOW:
            yield (
                each,
                f"has z = {z:g} m, which is below the origin: z points down in PX4 (NED), use {-z:g} for {z:g} m up",
            )
        elif is_landed and math.isnan(z) and speed > 0:
            yield each, f"has the velocity z = {speed:g} m/s, which points down (NED): use {-speed:g} to climb"
        if thrust > 0 and vehicle.state("vehicle_status").get("vehicle_type") == ROTARY_WING:
            yield (
                each,
                f"has `thrust_body[2]` = {thrust:g}, which points down (FRD): use {-thrust:g} for a multicopter",
            )
