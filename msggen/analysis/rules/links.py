"""The links of a vehicle: the remote control, the ground station, and programs that send setpoints."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid
from msggen.analysis.spans import common
from msggen.base.diagnostics import counted
from msggen.messages.nav_states import OFFBOARD

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column
    from msggen.analysis.spans import Spans

_MANUAL = "failsafe_flags.manual_control_signal_lost", "vehicle_status.rc_signal_lost"
_GROUND = "failsafe_flags.gcs_connection_lost", "vehicle_status.gcs_connection_lost", "vehicle_status.data_link_lost"
_SENT = ("offboard_control_mode.timestamp",)
_RARE = 0.5
"""The longest time in s between two samples of a program: PX4 wants them at 2 Hz."""


def _lost(paths: tuple[str, ...], name: str, action: str, default: float, flight: Flight) -> Iterator[Seen]:
    flag = flight.first(paths)
    there = flag._replace(values=1 - flag.values).since_above(0) if flag else None  # many fly without one
    stretch = flight.below(there, 1)
    if stretch and stretch.seconds > 0:
        is_used = flight.parameter(action, default) > 0
        values = {"lost_s": stretch.seconds, "action": flight.parameter(action, default)}
        text = f"the {name} was lost for {stretch.seconds:.1f} s"
        yield Seen(text, stretch.begin, stretch.end, values, "" if is_used else "info")


def _offboard(flight: Flight) -> Spans:
    """Return when the vehicle flew in Offboard mode."""
    state = flight.recorded.column("vehicle_status", "nav_state")
    return flight.when(state, state.values == OFFBOARD) if state else ()


def _offboard_lost(flight: Flight) -> Iterator[Seen]:
    flag = flight.first(("failsafe_flags.offboard_control_signal_lost", "vehicle_status.offboard_control_signal_lost"))
    there = flag._replace(values=1 - flag.values).since_above(0) if flag else None
    if not flag or not there:
        return
    chosen, others = _with_failsafe(flight), _of_others(flight, flag)
    allowed = flight.parameter("COM_OF_LOSS_T", 1.0)
    for within, level in ((common(chosen, flight.without(others)), ""), (common(chosen, others), "info")):
        stretch = flight.below(there, 1, within)
        if stretch and stretch.seconds > 0:
            text = f"Offboard mode had no setpoints to follow for {stretch.seconds:.1f} s"
            text += ", after another failsafe began" if level else ""
            yield Seen(text, stretch.begin, stretch.end, {"lost_s": stretch.seconds, "limit_s": allowed}, level)


def _of_others(flight: Flight, flag: Column) -> Spans:
    """Return the failsafes that began when setpoints were there: a program may stop because of them."""
    return tuple(each for each in flight.timeline.failsafes if not flag.value_at(each[0] + _RARE))


def _with_failsafe(flight: Flight) -> Spans:
    """Return when the vehicle was in the air and the pilot or a program had chosen Offboard mode."""
    state = flight.first(("vehicle_status.nav_state_user_intention", "vehicle_status.nav_state"))
    return common(flight.in_air, flight.when(state, state.values == OFFBOARD)) if state else ()


def _late(flight: Flight) -> Iterator[Seen | Unsaid]:
    sent = flight.first(_SENT)
    flown = common(flight.in_air, _offboard(flight))
    if not sent or not flown:
        return
    dropped = max((each.duration / 1e9 for each in flight.log.dropouts), default=0.0)
    gaps = flight.gaps(sent, _RARE + dropped, flown)
    if gaps:
        longest = max(end - begin for begin, end in gaps)
        text = f"the setpoints of a program came late {counted(len(gaps), 'time')}, by up to {longest:.1f} s"
        values = {"gaps": len(gaps), "longest_s": longest, "limit_s": _RARE + dropped}
        yield Seen(text, gaps[0][0], gaps[-1][1], values)


RULES = (
    FlightRule(
        "MANUAL_CONTROL_LOST",
        "the remote control or joystick was lost in flight",
        partial(_lost, _MANUAL, "remote control", "NAV_RCL_ACT", 2),
        needs=(_MANUAL,),
        uses=("vehicle_status", "actuator_armed"),
        fix="Check antennas, range and interference. NAV_RCL_ACT is what the vehicle does, COM_RC_LOSS_T after which "
        "time.",
        source="PX4's own flag, which COM_RC_LOSS_T decides. A note if NAV_RCL_ACT is 0",
        example="the remote control was lost for 3.0 s",
    ),
    FlightRule(
        "GROUND_STATION_LOST",
        "the connection to the ground station was lost in flight",
        partial(_lost, _GROUND, "ground station", "NAV_DLL_ACT", 0),
        needs=(_GROUND,),
        uses=("vehicle_status", "actuator_armed"),
        fix="Check the telemetry radio, its antennas and its range. NAV_DLL_ACT is what the vehicle does, "
        "COM_DL_LOSS_T after which time.",
        source="PX4's own flag, which COM_DL_LOSS_T decides. A note if NAV_DLL_ACT is 0, its default",
        example="the ground station was lost for 12.0 s",
    ),
    FlightRule(
        "OFFBOARD_LOST",
        "Offboard mode lost its setpoints: a program stopped sending, or an estimate that they need was missing",
        _offboard_lost,
        needs=(
            ("failsafe_flags.offboard_control_signal_lost", "vehicle_status.offboard_control_signal_lost"),
            ("vehicle_status.nav_state",),
        ),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected"),
        fix="Look whether the program stopped or its link broke, and at the other findings of that time. "
        "COM_OBL_RC_ACT is what the vehicle does.",
        source="PX4's own flag, which COM_OF_LOSS_T decides, 1 s by default. A note in a failsafe that began before",
        example="Offboard mode had no setpoints to follow for 4.0 s",
    ),
    FlightRule(
        "SETPOINTS_RARE",
        "a program in Offboard mode sent too rarely",
        _late,
        needs=(_SENT, ("vehicle_status.nav_state",)),
        uses=("vehicle_status", "actuator_armed", "vehicle_land_detected"),
        fix="Send offboard_control_mode and setpoints from a timer, at 10 Hz or more, and not from a callback that may "
        "wait.",
        source="PX4 wants 2 Hz: 0.5 s, and the longest dropout of the logger",
        example="the setpoints of a program came late 2 times, by up to 0.8 s",
    ),
)
"""The rules."""
