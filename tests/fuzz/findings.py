"""Flights of a stranger, for the rules about flights: values of any size, times, shapes and texts.

Every rule says something about each of them: findings whose texts are lines and whose times are in the recording, in a
bounded time and memory, and as JSON that every parser reads.
"""

from __future__ import annotations

import json
import math
import re
import struct
from pathlib import Path
from random import Random
from typing import NamedTuple

from msggen import recordings
from msggen.analysis.document import document_of, examined
from msggen.analysis.finding import LEVELS
from msggen.analysis.rules.table import FLIGHT, TOPICS
from msggen.base.diagnostics import printable
from msggen.recordings import RecordingError
from support.scratch import scratch_folder
from support.ulog import UlogWriter

COUNT = 150

_CODES = {"float": "f", "double": "d", "bool": "B", "uint8_t": "B", "int32_t": "i", "uint64_t": "Q"}
_FLOATS = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45, 0.0, -1.0, 0.5, 1.0, 2.0, 12.0, 47.1, -120.0)
_PATHS = sorted({path for rule in FLIGHT for paths in rule.needs for path in paths if "." in path})
_MORE = (
    *("vehicle_status.nav_state", "vehicle_status.vehicle_type", "vehicle_status.nav_state_user_intention"),
    *("vehicle_land_detected.ground_contact", "failsafe_flags.a", "failsafe_flags.battery_warning", "sensor_gps.eph"),
    *(
        "actuator_motors.control[12]",
        "sensor_combined.accelerometer_m_s2[3]",
        "sensor_gps.vel_m_s",
        "esc_status.esc_count",
    ),
    *("esc_status.esc_online_flags", "vehicle_local_position.delta_xy[2]", "vehicle_local_position.v_z_valid"),
    *("vehicle_magnetometer.magnetometer_ga[3]", "vehicle_thrust_setpoint.xyz[3]", "actuator_armed.kill"),
    *(
        "failure_detector_status.fd_roll",
        "battery_status.cell_count",
        "battery_status.connected",
        "sensor_gps.longitude_deg",
    ),
    *("estimator_status.mag_strength_gs", "vehicle_imu_status.accel_clipping[3]", "system_power.usb_connected"),
)
_NAMES = (
    "BAT_LOW_THR",
    "BAT1_V_EMPTY",
    "BAT1_N_CELLS",
    "COM_WIND_WARN",
    "COM_CPU_MAX",
    "MPC_LAND_SPEED",
    "NAV_DLL_ACT",
)
_TEXTS = ("", "\n::error::", "\x1b[2J", "a" * 60_000, "\udc80", "Failsafe activated", "<b>", "{0}", "%s")


class Case(NamedTuple):
    """A recording that follows from a seed: what is strange about it, and how many samples it has."""

    seed: int
    samples: int
    strangeness: float
    """The share of values, types and times that are odd."""
    is_wide: bool
    """Whether arrays and lists of flags are huge."""


def case(chance: Random) -> Case:
    samples = chance.choice((0, 1, 2, 40, 400, 4000))
    return Case(chance.randrange(1 << 32), samples, chance.choice((0.0, 0.02, 0.3, 1.0)), chance.random() < 0.2)


def check(case: Case) -> None:
    with scratch_folder() as folder:
        path = _written(folder / "flight.ulg", case)
        try:
            with recordings.open(path) as log:
                flight, findings = examined(log)
                document = document_of(flight, findings)
        except RecordingError:
            assert not case.samples
            return
    told = {*(each["rule"] for key in ("findings", "unsaid") for each in document[key]), *document["clear"]}
    assert told == {rule.id for rule in FLIGHT}
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert len(document["findings"]) <= 20 * len(FLIGHT)
    for each in document["findings"]:
        assert each["level"] in LEVELS
        assert len(printable(each["text"])) < 1000
        assert all(time is None or 0 <= time <= flight.duration for time in (each["time"], each["end"]))
        assert each["time"] is None or each["end"] is None or each["time"] <= each["end"]


def _written(path: Path, case: Case) -> str:
    chance = Random(case.seed)  # noqa: S311 - no secret
    writer = UlogWriter(start=0)
    for name in chance.sample(_NAMES, chance.randrange(len(_NAMES))):
        writer.parameter(name, chance.choice(_FLOATS))
    topics = _topics(chance, case)
    layouts: list[list[str]] = []
    for topic, fields in topics.items():
        if topic in ("failsafe_flags", "failure_detector_status") and case.is_wide:
            fields |= {f"flag_{index}": "bool" for index in range(4000)}
        writer.format(topic, ";".join(["uint64_t timestamp", *(f"{type_} {name}" for name, type_ in fields.items())]))
        for instance in range(chance.choice((1, 1, 1, 2, 5))):
            writer.subscribe(len(layouts), topic, instance)
            layouts.append(["Q", *(_code(type_) for type_ in fields.values())])
    time = 0
    for _ in range(case.samples):
        time += chance.choice((1_000, 20_000, 500_000))
        odd = chance.random() < case.strangeness / 10
        stamp = chance.choice((0, time // 2, time + 10**9, (1 << 64) - 1)) if odd else time
        number = chance.randrange(len(layouts))
        if len(layouts[number]) < 500 or chance.random() < 0.05:
            writer.sample(
                number, struct.pack("<Q", stamp) + b"".join(_value(chance, case, each) for each in layouts[number][1:])
            )
        if chance.random() < 0.01:
            writer.text(chance.randrange(8), time, chance.choice(_TEXTS).encode(errors="replace").decode())
        if chance.random() < 0.003:
            writer.dropout(chance.choice((0, 100, 65535)))
    return writer.write(path)


def _topics(chance: Random, case: Case) -> dict[str, dict[str, str]]:
    """Return the types of the fields of each topic."""
    topics: dict[str, dict[str, str]] = {}
    for each in chance.sample([*_PATHS, *_MORE], chance.randrange(1, len(_PATHS) + len(_MORE))):
        topic, _, field = each.partition(".")
        name, _, length = field.partition("[")
        topics.setdefault(topic, {})[name] = _type(chance, case, name, length.rstrip("]"))
    for topic in chance.sample(sorted(TOPICS), 3):
        topics.setdefault(topic, {})
    return topics


def _type(chance: Random, case: Case, name: str, length: str) -> str:
    """Return the type of a field: the usual one, or any."""
    if chance.random() < case.strangeness / 5:
        return chance.choice([*_CODES]) + chance.choice(("", "", "[1]", "[3]"))
    usual = (
        "float"
        if length or re.search(r"_v|_a$|_gs|ratio|speed|load|usage|remaining|deg|vel|eph|metric|^v", name)
        else "uint8_t"
    )
    return usual + (f"[{60 * int(length) if case.is_wide else length}]" if length else "")


def _code(type_: str) -> str:
    name, _, length = type_.partition("[")
    return f"{length.rstrip(']') or 1}{_CODES[name]}"


def _value(chance: Random, case: Case, code: str) -> bytes:
    count, kind = int(code[:-1]), code[-1]
    size = struct.calcsize(f"<{kind}")
    if kind in "fd":
        return struct.pack(f"<{count}{kind}", *([_float(chance, case)] * count))
    if chance.random() < case.strangeness / 3:
        return chance.randbytes(size * count)
    return chance.choice((0, 1, 1, 2, 2, 3)).to_bytes(size, "little") * count


def _float(chance: Random, case: Case) -> float:
    value = chance.choice(_FLOATS[8:])
    return chance.choice(_FLOATS) if chance.random() < case.strangeness else value * chance.uniform(0.9, 1.1)
