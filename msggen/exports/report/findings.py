"""What a reader should know at once: failures, failsafes, and values beyond their usual limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from msggen.base.diagnostics import counted, few
from msggen.base.recording_formats import FORMATS
from msggen.exports.report.flight import HAS_FIX, batteries_of
from msggen.exports.report.recorded import Column, Recorded, spans
from msggen.exports.report.timeline import Timeline

VIBRATION = 4.9, 9.8
"""Half of the earth's acceleration, and all of it, in m/s², from which vibration is high, or severe."""
LOW_BATTERY = 0.15
HIGH_LOAD = 0.9
SATURATED = 0.99
_MOST_SATURATED = 0.05
"""The share of the time in which a motor can be at its limit."""
_LONG = 1.0
"""The time in s from which a limit that is exceeded counts."""
_MOST_FAILSAFES = 5
"""The failsafes that are findings of their own."""
_TESTED = {"vel": "velocity", "pos": "position", "hgt": "height", "hdg": "heading", "mag": "magnetic field"}
"""What the estimator tests, by the fronts of its ratios."""
_RESET = {"xy": "horizontal position", "z": "height", "heading": "heading"}
"""The estimates that jump, by the fronts of their counters."""
_SEVERE = ("emergency", "alert", "critical", "error")


class Finding(NamedTuple):
    """Something that a reader should know."""

    level: str
    """`error`, `warning` or `info`."""
    text: str
    time: float | None = None
    """When it began, in s."""


def findings_of(recorded: Recorded, timeline: Timeline) -> list[Finding]:
    """Return the findings about a flight, the worst ones first."""
    found = [each for rule in _RULES for each in rule(recorded, timeline)]
    return sorted(found, key=lambda each: ("error", "warning", "info").index(each.level))


def _of_file(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    log = recorded.log
    if log.problems:
        yield Finding("error", f"the recording is damaged: {counted(len(log.problems), 'problem')}, listed below")
    if "hardfault_plain" in log.information:
        yield Finding("error", "the firmware crashed before this log: it has the text of a hard fault")
    if log.dropouts:
        seconds = [each.duration / 1e9 for each in log.dropouts]
        lost = f"{sum(seconds):.2f} s are missing, at most {max(seconds):.2f} s at a time"
        text = f"{counted(len(seconds), 'dropout')} of the logger: {lost}"
        yield Finding("warning", text, (log.dropouts[0].time - log.start) / 1e9)


def _of_failsafes(_: Recorded, timeline: Timeline) -> Iterator[Finding]:
    found = timeline.failsafes
    for begin, end in found[:_MOST_FAILSAFES]:
        mode = timeline.mode_at(begin)
        yield Finding("warning", f"failsafe for {end - begin:.1f} s" + (f", in mode {mode}" if mode else ""), begin)
    if len(found) > _MOST_FAILSAFES:
        rest = found[_MOST_FAILSAFES:]
        text = f"{counted(len(rest), 'more failsafe')}, {sum(end - begin for begin, end in rest):.1f} s in all"
        yield Finding("warning", text, rest[0][0])


def _of_failures(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    found = {}
    for flag in recorded.flags("failure_detector_status"):
        column = recorded.column("failure_detector_status", flag)
        seconds, begin = _beyond(recorded, column, 0.0)
        if seconds > 0 and begin is not None:
            found[flag] = begin
    if found:
        yield Finding("error", f"the failure detector reports {few(list(found))}", min(found.values()))


def _of_end(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    landed = recorded.column("vehicle_land_detected", "landed")
    is_armed = bool(recorded.armed) and recorded.armed[-1][1] >= recorded.duration
    if landed and is_armed and not landed.values[-1]:
        is_vehicles = FORMATS[recorded.log.kind].is_of_vehicle  # other recorders are ended at any time
        level = "warning" if is_vehicles else "info"
        yield Finding(level, "the recording ends in the air", recorded.duration)


def _of_texts(_: Recorded, timeline: Timeline) -> Iterator[Finding]:
    for level, levels in (("error", _SEVERE), ("warning", ("warning",))):
        found = [mark for mark in timeline.marks if mark.level in levels]
        if found:
            texts = few(list(dict.fromkeys(mark.text.strip() for mark in found)))
            yield Finding(level, f"{counted(len(found), level)} in the vehicle's log: {texts}", found[0].time)


def _of_vibration(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    for instance in recorded.instances("vehicle_imu_status"):
        metric = recorded.while_armed("vehicle_imu_status", "accel_vibration_metric", instance)
        worst = metric.finite.max() if metric else 0.0
        if metric and worst >= VIBRATION[0]:
            level, word = ("error", "severe") if worst >= VIBRATION[1] else ("warning", "high")
            text = f"{word} vibration of IMU {instance}: up to {worst:.1f} m/s²"
            yield Finding(level, text, _first(metric, VIBRATION[0]))
        clips = [recorded.column("vehicle_imu_status", f"accel_clipping[{axis}]", instance) for axis in range(3)]
        grown = sum(each.values[-1] - each.values[0] for each in clips if each is not None and len(each.values))
        if grown > 0:
            yield Finding("warning", f"the accelerometer of IMU {instance} reached its limit {grown:.0f} times")


def _of_battery(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    for instance in batteries_of(recorded):
        share = recorded.column("battery_status", "remaining", instance)
        known = share._replace(values=np.where(share.values >= 0, share.values, np.nan)) if share else None
        if known and len(known.finite) and known.finite.min() < LOW_BATTERY:
            text = f"the battery fell to {known.finite.min() * 100:.0f} %"
            yield Finding("warning", text, _first(known._replace(values=-known.values), -LOW_BATTERY))


def _of_estimator(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    for name, word in _TESTED.items():
        ratio = recorded.column("estimator_status", f"{name}_test_ratio")
        seconds, begin = _beyond(recorded, ratio, 1.0)
        if seconds >= _LONG:
            yield Finding("warning", f"the estimator rejected the {word} for {seconds:.1f} s", begin)
    for name, word in _RESET.items():
        column = recorded.column("vehicle_local_position", f"{name}_reset_counter")
        if column is None:
            continue
        jumps = column.times[1:][(np.diff(column.values) != 0) & column.is_within(recorded.armed)[1:]]
        if len(jumps):
            text = f"the estimate of the {word} jumped {counted(len(jumps), 'time')} while armed"
            yield Finding("info", text, float(jumps[0]))


def _of_gps(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    for topic in ("sensor_gps", "vehicle_gps_position"):
        fix = recorded.column(topic, "fix_type")
        if fix is None:
            continue
        had = np.flatnonzero(fix.values >= HAS_FIX)
        if len(had):  # a vehicle indoors never has one
            later = fix._replace(times=fix.times[had[0] :], values=-fix.values[had[0] :])
            seconds, begin = _beyond(recorded, later, -HAS_FIX)
            if seconds > 0:
                yield Finding("warning", f"the GPS had no fix for {seconds:.1f} s", begin)
        jammed = recorded.column(topic, "jamming_state")
        seconds, begin = _beyond(recorded, jammed, 1.0)
        if seconds > 0:
            yield Finding("warning", f"the GPS reports jamming for {seconds:.1f} s", begin)
        return


def _of_motors(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    armed = sum(end - begin for begin, end in recorded.armed)
    for index in range(recorded.width("actuator_motors", "control")):
        seconds, begin = _beyond(recorded, recorded.column("actuator_motors", f"control[{index}]"), SATURATED)
        if armed > 0 and seconds > max(_MOST_SATURATED * armed, _LONG):
            share = f"{100 * seconds / armed:.0f} % of the time armed"
            yield Finding("warning", f"motor {index + 1} was at its limit for {seconds:.1f} s, {share}", begin)


def _of_system(recorded: Recorded, _: Timeline) -> Iterator[Finding]:
    for field, word in (("load", "the load of the CPU"), ("ram_usage", "the used memory")):
        found = recorded.column("cpuload", field)
        if found and len(found.finite) and found.finite.max() > HIGH_LOAD:
            yield Finding("warning", f"{word} reached {found.finite.max() * 100:.0f} %", _first(found, HIGH_LOAD))
    changed = recorded.log.facts.changed_parameters
    if changed:
        names = few(list(dict.fromkeys(name for _, name, _ in changed)))
        yield Finding("info", f"parameters changed during the log: {names}", (changed[0][0] - recorded.log.start) / 1e9)


_RULES: Sequence[Callable[[Recorded, Timeline], Iterator[Finding]]] = (
    _of_file,
    _of_end,
    _of_failsafes,
    _of_failures,
    _of_texts,
    _of_vibration,
    _of_battery,
    _of_estimator,
    _of_gps,
    _of_motors,
    _of_system,
)


def _first(column: Column, limit: float) -> float | None:
    """Return when a value first exceeds a limit."""
    found = np.flatnonzero(column.values > limit)
    return float(column.times[found[0]]) if len(found) else None


def _beyond(recorded: Recorded, column: Column | None, limit: float) -> tuple[float, float | None]:
    """Return for how long a value exceeds a limit while armed, in s, and from when on."""
    if column is None or not len(column.times):
        return 0.0, None
    mask = (column.values > limit) & column.is_within(recorded.armed)
    stretches = spans(column, mask, float(column.times[-1]))
    return sum(end - begin for begin, end in stretches), stretches[0][0] if stretches else None
