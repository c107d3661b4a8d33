"""Motors and their controllers (ESCs)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from msggen.analysis.finding import FlightRule, Seen, Unsaid
from msggen.analysis.spans import common
from msggen.base.diagnostics import few
from msggen.check.finding import Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.spans import Spans

SATURATED = 0.99
_MOST = 0.05
"""The share of the time armed in which a motor may be at its limit."""
_LONGEST = 1.0
"""The same in s."""
_MOTORS = 16
"""The motors that are looked at: PX4 has 12."""
_RUNNING, _STOPPED_S, _OFFLINE_S = 0.1, 0.5, 0.3
"""The command of a motor that turns, and the times in s for which one may stand, and an ESC may be silent."""
_ROTARY_WING = 1
"""A `vehicle_type` of VehicleStatus."""
_FIRST = 101
"""The `actuator_function` of the first motor."""
_FAILURES = (
    *("over current", "over voltage", "motor too hot", "too fast", "inconsistent command", "motor stuck"),
    *("generic failure", "motor hot", "ESC hot", "ESC too hot"),
)
"""The bits of `failures` in an EscReport."""


def _hovering(flight: Flight) -> Spans:
    """Return when a multicopter was armed, and a VTOL that did not fly forward; nothing for other vehicles."""
    names = "vehicle_type", "is_vtol", "in_transition_mode"
    kind, vtol, transition = (flight.recorded.column("vehicle_status", name) for name in names)
    armed = flight.recorded.armed
    if kind is None:
        return armed
    is_rotary = kind.values == _ROTARY_WING
    if not (vtol and vtol.largest > 0):
        return armed if is_rotary.all() else ()
    return common(armed, flight.when(kind, is_rotary & ~(transition.at(kind.times) > 0) if transition else is_rotary))


def _is_pusher(flight: Flight, index: int) -> bool:
    """Whether a motor pushes forward, as the axes of the rotors say that control allocation knows."""
    forward, down = (flight.parameter(f"CA_ROTOR{index}_A{axis}", default) for axis, default in (("X", 0), ("Z", -1)))
    return abs(forward) > abs(down)


def _saturated(flight: Flight) -> Iterator[Seen | Unsaid]:
    recorded, hovering = flight.recorded, _hovering(flight)
    armed = sum(end - begin for begin, end in hovering)
    if not hovering:
        yield Unsaid("only multicopters, and VTOLs that hover, must not fly at full throttle")
    for index in range(min(recorded.width("actuator_motors", "control"), _MOTORS)):
        if _is_pusher(flight, index):
            continue
        stretch = flight.above(recorded.column("actuator_motors", f"control[{index}]"), SATURATED, hovering)
        if stretch and stretch.seconds > max(_MOST * armed, _LONGEST):
            share = stretch.seconds / armed
            at = f"{stretch.seconds:.1f} s, {100 * share:.0f} % of the time armed"
            values = {"motor": index + 1, "saturated_s": stretch.seconds, "share": share, "limit": SATURATED}
            yield Seen(f"motor {index + 1} was at its limit for {at}", stretch.begin, stretch.end, values)


def _stopped(flight: Flight) -> Iterator[Seen | Unsaid]:
    recorded = flight.recorded
    kind, vtol = (recorded.column("vehicle_status", name) for name in ("vehicle_type", "is_vtol"))
    if (kind and kind.largest != _ROTARY_WING) or (vtol and vtol.largest > 0):
        yield Unsaid("only multicopters must not stop a motor in flight")
        return
    found = (
        recorded.column("actuator_motors", f"control[{index}]")
        for index in range(min(recorded.width("actuator_motors", "control"), _MOTORS))
    )
    columns = [(index, each, each.is_within(flight.in_air)) for index, each in enumerate(found) if each]
    running = [each for each in columns if (abs(each[1].values[each[2]]) > _RUNNING).any()]
    turning: Any = sum((abs(each.values) > _RUNNING).astype(int) for _, each, _ in running)
    for index, column, is_flying in running:
        is_zero = ~(abs(column.values) > 0)  # or NaN; a reversible motor turns below 0, too
        times = flight.when(column, is_zero & (2 * turning >= len(running)) & is_flying)
        long = [each for each in times if each[1] - each[0] >= _STOPPED_S]
        if long:
            seconds = sum(end - begin for begin, end in long)
            text = f"motor {index + 1} was stopped in flight for {seconds:.1f} s while others turned"
            yield Seen(text, long[0][0], long[-1][1], {"motor": index + 1, "stopped_s": seconds})


def _escs(flight: Flight) -> Iterator[Seen]:
    recorded = flight.recorded
    count = recorded.column("esc_status", "esc_count")
    most = int(min(count.largest, _MOTORS)) if count and count.largest > 0 else 0
    for index in range(min(most, recorded.width("esc_status", "esc"))):
        function = recorded.column("esc_status", f"esc[{index}].actuator_function")
        told = int(function.largest) - _FIRST if function and _FIRST <= function.largest < _FIRST + _MOTORS else index
        yield from _esc(flight, index, told)


def _esc(flight: Flight, index: int, motor: int) -> Iterator[Seen]:
    """Yield what an ESC reports, and what it does not. `index` is its place, `motor` the one that it drives, from 0."""
    recorded = flight.recorded
    failures = recorded.column("esc_status", f"esc[{index}].failures")
    stretch = flight.above(failures, 0.0, flight.in_air)
    if failures and stretch and stretch.seconds > 0:
        values = failures.within(flight.in_air).values.astype(int)
        bits = [name for bit, name in enumerate(_FAILURES) if (values & (1 << bit)).any()]
        text = f"the ESC of motor {motor + 1} reports {few(bits) or 'a failure'}"
        evidence: dict[str, float | str] = {
            "motor": motor + 1,
            "failing_s": stretch.seconds,
            "failures": ", ".join(bits),
        }
        yield Seen(text, stretch.begin, stretch.end, evidence)
    online = recorded.column("esc_status", "esc_online_flags")
    if online:
        bit = online._replace(values=online.values // (1 << index) % 2).since_above(0)
        stretch = flight.below(bit, 1, flight.in_air)
        if stretch and stretch.seconds >= _OFFLINE_S:
            text = f"the ESC of motor {motor + 1} was offline for {stretch.seconds:.1f} s"
            yield Seen(text, stretch.begin, stretch.end, {"motor": motor + 1, "offline_s": stretch.seconds})
    speed = recorded.column("esc_status", f"esc[{index}].esc_rpm")
    command = recorded.column("actuator_motors", f"control[{motor}]")
    if speed and command and (speed.values != 0).any():
        standing = (speed.values == 0) & (abs(command.at(speed.times)) > _RUNNING) & speed.is_within(flight.in_air)
        long = [each for each in flight.when(speed, standing) if each[1] - each[0] >= _STOPPED_S]
        if long:
            seconds = sum(end - begin for begin, end in long)
            text = f"motor {motor + 1} stood for {seconds:.1f} s in flight, although it was to turn"
            yield Seen(text, long[0][0], long[-1][1], {"motor": motor + 1, "standing_s": seconds})


RULES = (
    FlightRule(
        "MOTOR_SATURATED",
        "a motor of a multicopter was at its limit for long, so the vehicle could not be controlled",
        _saturated,
        needs=(("actuator_motors",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="The vehicle is too heavy, its battery too weak, a propeller or motor is damaged, or its gains are too "
        "high. If it is one motor only, look at that one and the one opposite.",
        source="99 % of the range for 5 % of the time armed, and for a second, without pushers and forward flight of a "
        "VTOL",
        example="motor 1 was at its limit for 4.9 s, 100 % of the time armed",
    ),
    FlightRule(
        "MOTOR_STOPPED",
        "the output of a motor of a multicopter fell to zero in flight while others turned",
        _stopped,
        severity=Severity.ERROR,
        needs=(("actuator_motors",),),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected"),
        fix="PX4 stops a motor that its failure detector takes for failed (FD_ACT_EN, CA_FAILURE_MODE), and control "
        "allocation does so if the thrust is too low for the manoeuvre: MPC_THR_MIN and MC_AIRMODE change "
        "that.",
        source="0.5 s at zero in the air, while half of the motors are above 10 %",
        example="motor 2 was stopped in flight for 1.5 s while others turned",
    ),
    FlightRule(
        "ESC_FAILED",
        "a motor controller reports a failure, is offline, or its motor stands, in flight",
        _escs,
        severity=Severity.ERROR,
        needs=(("esc_status",),),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected", "actuator_motors"),
        fix="Do not fly before the ESC, its cables, the motor and the propeller are checked.",
        source="`failures` of EscReport; offline for 0.3 s, after which PX4 reports it; 0 rpm for 0.5 s above 10 %",
        example="the ESC of motor 3 was offline for 2.0 s",
    ),
)
"""The rules."""
