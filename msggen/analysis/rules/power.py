"""Batteries, and the supply of the flight controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.finding import FlightRule, Seen, Unsaid
from msggen.check.finding import Severity

if TYPE_CHECKING:
    from msggen.analysis.flight import Flight
    from msggen.analysis.recorded import Column

_SAG = 0.1
"""By how much the voltage of a cell in V may be below that of an empty one under load: BAT1_V_LOAD_DROP of v1.14."""
_LONGEST = 1.0
"""The time in s for which a value may be beyond its limit."""
_OHM, _WORN = 0.005, 4.0
"""The resistance of a cell that PX4 assumes, in Ohm, and how many times of it is too much."""
_CHANGE, _EXPLAINED = 0.05, -0.7
"""How much the current must change, as a share of its largest value, and how closely the voltage follows it."""
_RAIL_LOW, _RAIL_ERROR, _RAIL_HIGH = 4.8, 4.5, 5.4
"""The voltages in V beyond which PX4 reports the rail of 5 V, and below which it does not arm."""
_LAST, _BEFORE, _FALLEN = 2.0, 12.0, 0.1
"""The end of a recording and the time before it, in s, and the share by which a voltage falls that fails."""


def _each(find: Callable[[Flight, int], Iterator[Seen | Unsaid]], flight: Flight) -> Iterator[Seen | Unsaid]:
    """Yield what is seen of each battery, or that there is none."""
    found = list(flight.recorded.batteries())
    if not found:
        yield Unsaid("no battery is connected")
    for instance in found:
        yield from find(flight, instance)


def _name(flight: Flight, instance: int) -> str:
    """Return the name of a battery: with the number in its parameters if there are several."""
    return f"battery {instance + 1}" if len(list(flight.recorded.batteries())) > 1 else "the battery"


def _connected(flight: Flight, field: str, instance: int) -> Column | None:
    """Return a field of a battery, NaN while it is not connected."""
    found = flight.recorded.column("battery_status", field, instance)
    return found.where(flight.recorded.column("battery_status", "connected", instance)) if found else None


def _low(flight: Flight, instance: int) -> Iterator[Seen | Unsaid]:
    low, critical = flight.parameter("BAT_LOW_THR", 0.15), flight.parameter("BAT_CRIT_THR", 0.07)
    share = _connected(flight, "remaining", instance)
    known = share.known(0.0) if share else None
    if known and (silences := flight.silences(known)):
        seconds = sum(end - begin for begin, end in silences)
        yield Unsaid(f"{_name(flight, instance)} was silent for {seconds:.1f} s in flight")
    stretch = flight.below(known, low, flight.whole)
    if known and stretch:
        values = {"battery": instance + 1, "remaining": known.smallest, "limit": low}
        level = "error" if known.smallest < critical else ""
        text = f"{_name(flight, instance)} fell to {known.smallest * 100:.0f} %"
        yield Seen(text, stretch.begin, stretch.end, values, level)


def _cells(flight: Flight, instance: int) -> float:
    """Return the number of cells of a battery, 0 if it is not known."""
    told = flight.recorded.column("battery_status", "cell_count", instance)
    found = told.largest if told else 0.0
    return found if found >= 1 else max(flight.parameter(f"BAT{instance + 1}_N_CELLS", 0.0), 0.0)


def _sag(flight: Flight, instance: int) -> Iterator[Seen | Unsaid]:
    cells = _cells(flight, instance)
    volts = _connected(flight, "voltage_v", instance)
    if not cells:
        yield Unsaid(f"the number of cells is not known: set BAT{instance + 1}_N_CELLS")
        return
    limit = flight.parameter(f"BAT{instance + 1}_V_EMPTY", 3.6) - _SAG
    each = volts.known(0.1) if volts else None  # 0 is unknown
    each = each._replace(values=each.values / cells) if each else None
    stretch = flight.below(each, limit)
    worst = each.within(flight.recorded.armed).smallest if each else 0.0
    if stretch and stretch.seconds >= _LONGEST:
        at = f"{worst:.2f} V a cell, below {limit:.2f} V for {stretch.seconds:.1f} s"
        text = f"the voltage of {_name(flight, instance)} sagged to {at}"
        values = {"battery": instance + 1, "cell_v": worst, "limit_v": limit, "below_s": stretch.seconds}
        yield Seen(text, stretch.begin, stretch.end, values)


def _resistance(flight: Flight, instance: int) -> Iterator[Seen | Unsaid]:
    volts, amps = (
        flight.recorded.while_armed("battery_status", field, instance, "connected")
        for field in ("voltage_v", "current_a")
    )
    found = volts.fit(amps.known(0.0)) if volts and amps else None
    cells = _cells(flight, instance)
    if not found or not amps or not cells or found.spread < _CHANGE * amps.largest:
        yield Unsaid(
            f"the current of {_name(flight, instance)} hardly changed, or the number of its cells is not known"
        )
        return
    assumed = flight.parameter(f"BAT{instance + 1}_R_INTERNAL", _OHM)
    limit, each = _WORN * max(assumed, _OHM), -found.slope / cells
    if found.correlation <= _EXPLAINED and each > limit:
        values = {"battery": instance + 1, "cell_ohm": each, "limit_ohm": limit, "correlation": found.correlation}
        text = f"{_name(flight, instance)} has {each * 1000:.0f} mΩ a cell, more than {limit * 1000:.0f} mΩ"
        yield Seen(text, values=values)


def _rail(flight: Flight) -> Iterator[Seen]:
    volts, usb = (flight.recorded.column("system_power", name) for name in ("voltage5v_v", "usb_connected"))
    known = volts.known(0.1) if volts else None
    if known and usb:
        known = known.where(usb._replace(values=1 - usb.values))
    low, high = flight.below(known, _RAIL_LOW), flight.above(known, _RAIL_HIGH)
    shown = known.within(flight.recorded.armed) if known else None
    if shown and low:
        level = "error" if shown.smallest < _RAIL_ERROR else ""
        values = {"rail_v": shown.smallest, "limit_v": _RAIL_LOW}
        yield Seen(f"the rail of 5 V fell to {shown.smallest:.2f} V", low.begin, low.end, values, level)
    if shown and high:
        values = {"rail_v": shown.largest, "limit_v": _RAIL_HIGH}
        yield Seen(f"the rail of 5 V rose to {shown.largest:.2f} V", high.begin, high.end, values)


def _lost(flight: Flight) -> Iterator[Seen]:
    end = flight.duration
    if not flight.in_air or flight.in_air[-1][1] < end:
        return
    rail = flight.recorded.column("system_power", "voltage5v_v")
    batteries = [
        (_name(flight, each), flight.recorded.column("battery_status", "voltage_v", each))
        for each in flight.recorded.batteries()
    ]
    for name, column in (("the rail of 5 V", rail), *batteries):
        known = column.known(0.0) if column else None
        if known is None:
            continue
        last = known.within(((end - _LAST, end),)).smallest
        before = known.within(((end - _BEFORE, end - _LAST),)).smallest
        if last < (1 - _FALLEN) * before:
            values = {"last_v": last, "before_v": before}
            text = f"the recording ends in the air while {name} falls from {before:.2f} to {last:.2f} V"
            yield Seen(text, end - _LAST, end, values)
            return


RULES = (
    FlightRule(
        "BATTERY_LOW",
        "a battery was nearly empty",
        partial(_each, _low),
        needs=(("battery_status.remaining",),),
        uses=("vehicle_status",),
        fix="Land earlier, or set COM_LOW_BAT_ACT, the failsafe that does so. Check BAT1_CAPACITY and the calibration "
        "of voltage and current if the battery was not empty.",
        source="BAT_LOW_THR, 15 % by default; below BAT_CRIT_THR, 7 %, it is an error",
        example="the battery fell to 10 %",
    ),
    FlightRule(
        "BATTERY_SAG",
        "the voltage of a battery fell below that of an empty one under load",
        partial(_each, _sag),
        needs=(("battery_status.voltage_v",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Use a battery with a higher rate of discharge or more capacity, or replace an old or a cold one. Check "
        "its plugs, too.",
        source="BAT1_V_EMPTY, 3.6 V a cell by default, less 0.1 V for the load, for a second",
        example="the voltage of the battery sagged to 3.20 V a cell, below 3.50 V for 4.0 s",
    ),
    FlightRule(
        "BATTERY_RESISTANCE",
        "a battery has a high internal resistance: its voltage falls much with the current",
        partial(_each, _resistance),
        needs=(("battery_status.voltage_v",), ("battery_status.current_a",)),
        uses=("vehicle_status", "actuator_armed"),
        fix="Replace the battery, or check plugs and cables: their resistance counts, too.",
        source="4 times BAT1_R_INTERNAL, or 5 mΩ a cell, which PX4 assumes; the voltage follows the current with a "
        "correlation of -0.7 or stronger",
        example="the battery has 30 mΩ a cell, more than 20 mΩ",
    ),
    FlightRule(
        "SUPPLY_VOLTAGE",
        "the supply of the flight controller was not near 5 V",
        _rail,
        needs=(("system_power.voltage5v_v",),),
        uses=("vehicle_status", "actuator_armed"),
        fix="Check the power module and its cable. Supply servos and companion computers from another regulator.",
        source="PX4 warns below 4.8 V and above 5.4 V, and does not arm below 4.5 V: an error",
        example="the rail of 5 V fell to 4.60 V",
    ),
    FlightRule(
        "POWER_LOST",
        "the recording ends in the air while a voltage falls: the power failed",
        _lost,
        severity=Severity.ERROR,
        needs=(("vehicle_land_detected.landed",), ("system_power.voltage5v_v", "battery_status.voltage_v")),
        uses=("vehicle_status", "actuator_armed", "battery_status", "system_power"),
        fix="Check the battery, its plug, the power module and its cable before the next flight.",
        source="10 % less in the last 2 s than in the 10 s before them",
        example="the recording ends in the air while the battery falls from 15.20 to 9.10 V",
    ),
)
"""The rules."""
