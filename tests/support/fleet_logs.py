"""A folder of small ULogs of three vehicles, of which one file is cut and one is no recording."""

from __future__ import annotations

import math
import struct
from datetime import datetime, timezone
from pathlib import Path

from support.ulog import UlogWriter

FORMATS = {
    "vehicle_local_position": "uint64_t timestamp;float x;float y;float z;float vz",
    "battery_status": "uint64_t timestamp;float voltage_v;float remaining;uint8_t id;uint8_t[3] _padding0",
    "vehicle_status": "uint64_t timestamp;uint8_t arming_state;uint8_t nav_state;uint8_t[6] _padding0",
    "sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;uint8_t[7] _padding0",
}
_LATER = ";float temperature"
"""A field that newer firmware has more."""
_SECONDS = 20
_RATE = 10
VEHICLES = ("00060000000033343531303437", "0006000000003832393034313a", "00060000000037363231353530")


def write_logs(folder: Path) -> Path:
    """Write the folder. Return its path."""
    names = (
        ("2026-11-20/10_02_11.ulg", 0, ""),
        ("2026-11-20/10_31_40.ulg", 0, "2026-11-20T10:31:40"),
        ("2026-11-21/10_02_11.ulg", 1, "2026-11-21T10:02:11"),
        ("2026-11-21/15_47_03.ulg", 1, "2026-11-21T15:47:03"),
        ("hangar/sess001.ulg", 2, ""),
    )
    for number, (name, vehicle, day) in enumerate(names):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        utc = datetime.fromisoformat(day).replace(tzinfo=timezone.utc).timestamp() if day else 0
        flight(number, VEHICLES[vehicle], int(utc * 1e6), is_new=vehicle > 0).write(path)
    whole = (folder / names[3][0]).read_bytes()
    (folder / "2026-11-21" / "16_20_55.ulg").write_bytes(whole[: len(whole) * 2 // 5])
    (folder / "2026-11-21" / "notes.ulg").write_text("battery 2 is swollen\n")
    return folder


def flight(number: int, vehicle: str, utc: int, *, is_new: bool) -> UlogWriter:
    """Return a ULog: a climb, a descent, and a battery that empties. `utc` is the time at its start in us, or 0."""
    log = UlogWriter()
    for name, fields in FORMATS.items():
        log.format(name, fields + _LATER * (is_new and name == "battery_status"))
    log.information(f"char[{len(vehicle)}] sys_uuid", vehicle.encode())
    log.information("char[3] sys_name", b"PX4")
    log.information("uint32_t ver_sw_release", struct.pack("<I", 0x011100FF))
    log.parameter("BAT1_N_CELLS", 4)
    log.parameter("MPC_Z_VEL_MAX_UP", 5.0 if is_new else 3.0)
    log.parameter("BAT1_N_CELLS", 0, default=3)
    if is_new:
        log.parameter("MPC_Z_VEL_MAX_UP", 3.0, default=3)
    topics = [("vehicle_local_position", 0), ("battery_status", 0), ("vehicle_status", 0), ("sensor_gps", 0)]
    topics += [("battery_status", 1)] * is_new
    for index, (topic, instance) in enumerate(topics):
        log.subscribe(index, topic, instance)
    for step in range(_SECONDS * _RATE):
        stamp = 5_000_000 + step * 1_000_000 // _RATE
        share = step / (_SECONDS * _RATE)
        height = (10 + 5 * number) * math.sin(math.pi * share)
        log.sample(0, struct.pack("<Q4f", stamp, share, 0.0, -height, 0.0))
        if step % 5 == 0:
            for index in (1, 4)[: 1 + is_new]:
                voltage = 16.2 - (1.2 + 0.3 * number) * share - 0.1 * (index == 4)
                newer = struct.pack("<f", 20 + 15 * share) * is_new
                log.sample(index, struct.pack("<Q2fB3x", stamp, voltage, 1 - share, index // 4) + newer)
        if step % _RATE == 0:
            mode = 17 if share < 0.3 else 3 if share < 0.7 else 18
            log.sample(2, struct.pack("<QBB6x", stamp, 2, mode))
            log.sample(3, struct.pack("<QQB7x", stamp, utc and utc + stamp - 5_000_000, 3 if utc else 0))
        if step % 20 == 0:
            log.sync()
    return log


def write_small(path: Path, number: int) -> None:
    """Write a ULog of two topics with few samples, for tests of many runs."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = UlogWriter()
    for index, topic in enumerate(("battery_status", "vehicle_status")):
        log.format(topic, FORMATS[topic])
        log.subscribe(index, topic)
    log.information(f"char[{len(VEHICLES[0])}] sys_uuid", VEHICLES[number % 3].encode())
    for step in range(5 + number):
        log.sample(0, struct.pack("<Q2fB3x", 1000 * step, number, step, 0))
        log.sample(1, struct.pack("<QBB6x", 1000 * step, 2, number))
    log.write(path)
