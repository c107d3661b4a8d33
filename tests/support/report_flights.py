"""A flight with all that a report shows, as messages of a generated package, as an MCAP file and as a ULog.

It takes off, flies a square of 20 m with 4 m/s, fails to see the ground station on the way, and lands.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from support.log_files import definition_in
from support.ulog import UlogWriter, formats_of, snake
from support.written import write_recording

DURATION = 40.0
ARM, TAKEOFF, SQUARE, LAND, DISARM = 2.0, 3.0, 8.0, 30.0, 38.0
SIDE, SPEED, HEIGHT = 20.0, 4.0, 5.0
FAILSAFE = 26.0
"""When the failsafe begins, until the landing."""
MODES = (("MANUAL", 0.0), ("AUTO_TAKEOFF", ARM), ("POSCTL", SQUARE), ("AUTO_RTL", FAILSAFE), ("AUTO_LAND", LAND))
TURN = 0.3
"""The roll of the vehicle in rad while it flies east."""


class State(NamedTuple):
    """Where the vehicle is, and how fast it moves: north, east, down in m, and m/s."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


def state_at(time: float) -> State:
    """Return where the vehicle is."""
    if time < TAKEOFF:
        return State((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if time < SQUARE:
        return State(
            (0.0, 0.0, -HEIGHT * (time - TAKEOFF) / (SQUARE - TAKEOFF)), (0.0, 0.0, -HEIGHT / (SQUARE - TAKEOFF))
        )
    way = (time - SQUARE) * SPEED
    side, along = divmod(way, SIDE)
    corners = ((0, 0, 1, 0), (1, 0, 0, 1), (1, 1, -1, 0), (0, 1, 0, -1))
    if side < len(corners):
        north, east, to_north, to_east = corners[int(side)]
        place = (north * SIDE + to_north * along, east * SIDE + to_east * along, -HEIGHT)
        return State(place, (to_north * SPEED, to_east * SPEED, 0.0))
    down = min(max(time - LAND, 0.0) / (DISARM - 1 - LAND), 1.0)
    return State((0.0, 0.0, -HEIGHT * (1 - down)), (0.0, 0.0, HEIGHT / (DISARM - 1 - LAND) if 0 < down < 1 else 0.0))


def messages_of(package: Any) -> Iterator[tuple[str, float, Any]]:
    """Yield the samples of a flight: the name in uORB, the time in s, and the message."""
    for name, rate, make in _topics(package):
        for index in range(round(DURATION * rate)):
            time = index / rate
            message = make(time)
            yield name, time, type(message)(**{**_values(message), "timestamp": round(time * 1e6)})


def _values(message: Any) -> dict[str, Any]:
    return {field.name: getattr(message, field.name) for field in message.__msg__.fields}


def _topics(package: Any) -> Iterator[tuple[str, float, Callable[[float], Any]]]:
    status = package.VehicleStatus

    def vehicle_status(time: float) -> Any:
        mode = next(name for name, begin in reversed(MODES) if begin <= time)
        return status(
            nav_state=getattr(status, f"NAVIGATION_STATE_{mode}"),
            arming_state=2 if ARM <= time < DISARM else 1,
            failsafe=FAILSAFE <= time < LAND,
            vehicle_type=status.VEHICLE_TYPE_ROTARY_WING,
        )

    def local_position(time: float) -> Any:
        (x, y, z), (vx, vy, vz) = state_at(time)
        valid = dict.fromkeys(("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"), True)
        return package.VehicleLocalPosition(x=x, y=y, z=z, vx=vx, vy=vy, vz=vz, **valid)

    def setpoint(time: float) -> Any:
        found = state_at(time + 0.2)
        return package.TrajectorySetpoint(position=found.position, velocity=found.velocity, yaw=math.nan)

    def attitude(time: float) -> Any:
        roll = TURN if state_at(time).velocity[1] > 0 else 0.0
        return package.VehicleAttitude(q=(math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0))

    def battery(time: float) -> Any:
        return package.BatteryStatus(
            connected=True, voltage_v=16 - time / 20, current_a=-1.0, remaining=1 - time / 50, discharged_mah=time * 10
        )

    def motors(time: float) -> Any:
        thrust = 0.5 if ARM <= time < DISARM else math.nan
        return package.ActuatorMotors(control=(thrust,) * 4 + (math.nan,) * 8)

    def imu(time: float) -> Any:
        return package.VehicleImuStatus(accel_vibration_metric=6.0 if FAILSAFE <= time < LAND else 1.0)

    yield "vehicle_status", 5, vehicle_status
    yield "vehicle_local_position", 50, local_position
    yield "trajectory_setpoint", 10, setpoint
    yield "vehicle_attitude", 50, attitude
    yield "battery_status", 2, battery
    yield "actuator_motors", 20, motors
    yield "vehicle_imu_status", 2, imu
    yield "sensor_gps", 5, lambda _: package.SensorGps(fix_type=3, satellites_used=12, eph=0.8, epv=1.2)
    yield "cpuload", 2, lambda time: package.Cpuload(load=0.4 + 0.1 * math.sin(time), ram_usage=0.6)
    yield "failsafe_flags", 5, lambda time: package.FailsafeFlags(gcs_connection_lost=FAILSAFE <= time < LAND)
    yield (
        "vehicle_land_detected",
        2,
        lambda time: package.VehicleLandDetected(landed=time < TAKEOFF or time > DISARM - 1),
    )
    yield "vehicle_angular_velocity", 100, lambda time: package.VehicleAngularVelocity(xyz=(math.sin(time), 0.0, 0.1))


def write_mcap(path: Path, package: Any, name: Callable[[str], str] = "/fmu/out/{}".format) -> Path:
    """Write the flight as an MCAP file. `name` returns the name of a topic for that in uORB."""
    samples = sorted(messages_of(package), key=lambda sample: sample[1])
    return write_recording(path, [(name(topic), time, message) for topic, time, message in samples])


def write_ulog(path: Path, package: Any, texts: Mapping[str, str] | None = None) -> str:
    """Write the flight as a ULog of v1.18, with texts and parameters. `texts` replaces some names and texts in it."""
    changed = texts or {}
    writer = UlogWriter(start=0)
    writer.information("uint32_t ver_sw_release", (0x011200FF).to_bytes(4, "little"))
    for key, value in (("sys_name", "PX4"), ("ver_hw", changed.get("ver_hw", "PX4_FMU_V6X"))):
        writer.information(f"char[{len(value.encode())}] {key}", value.encode())
    writer.parameter("MPC_XY_VEL_MAX", 12.0)
    writer.parameter("MPC_XY_VEL_MAX", 8.0, default=1)
    writer.parameter(changed.get("parameter", "MPC_Z_VEL_MAX_UP"), 3)
    writer.parameter(changed.get("parameter", "MPC_Z_VEL_MAX_UP"), 2, default=3)
    samples = sorted(messages_of(package), key=lambda sample: sample[1])
    names = {name: type(message).__name__ for name, _, message in samples}
    numbers = {name: number for number, name in enumerate(names)}
    formats: dict[str, str] = {}
    for name, cls in names.items():
        found = formats_of(f"px4_msgs/msg/{cls}", definition_in("v1.18", cls))
        for inner, fields in found.items():
            writer.format(inner, fields)
        writer.subscribe(numbers[name], name)
        formats[name] = found[snake(cls)]
    for topic, time, message in samples:
        if topic == "vehicle_status" and time == FAILSAFE:
            writer.text(4, round(time * 1e6), changed.get("text", "Connection to ground station lost"))
            writer.parameter("MPC_XY_VEL_MAX", 6.0)
        writer.sample(numbers[topic], packed(message, formats[topic]))
    writer.dropout(120)
    return writer.write(path)


def write_other(path: Path, ulog: str) -> str:
    """Write the ULog of a flight again: of the board PX4_FMU_V5X, and with MPC_Z_VEL_MAX_DN for MPC_Z_VEL_MAX_UP."""
    content = Path(ulog).read_bytes().replace(b"PX4_FMU_V6X", b"PX4_FMU_V5X")
    path.write_bytes(content.replace(b"MPC_Z_VEL_MAX_UP", b"MPC_Z_VEL_MAX_DN"))
    return str(path)


def packed(message: Any, fields: str) -> bytes:
    """Return a message without others in it as a sample of a ULog."""
    signed = {"int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q"}
    codes = {f"u{name}": code.upper() for name, code in signed.items()} | signed
    codes |= {"float": "f", "double": "d", "bool": "?", "char": "B"}
    content = b""
    for field in fields.split(";"):
        type_, _, name = field.partition(" ")
        kind, _, length = type_.partition("[")
        count = int(length.rstrip("]") or 1)
        if name.startswith("_padding"):
            content += bytes(count)
            continue
        value = getattr(message, name)
        content += struct.pack(f"<{count}{codes[kind]}", *(value if length else (value,)))
    return content
