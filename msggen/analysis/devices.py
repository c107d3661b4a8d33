"""The sensors of a vehicle: their types and buses, from device ids in topics and calibrations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from msggen.analysis.recorded import Recorded
from msggen.messages.devices import device_id
from msggen.recordings.columns.ordered import distinct

_INFORMATION = "device_information"
_FIELDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "accelerometer": ("vehicle_imu_status.accel_device_id", "vehicle_imu.accel_device_id"),
        "gyroscope": ("vehicle_imu_status.gyro_device_id", "vehicle_imu.gyro_device_id"),
        "magnetometer": ("sensor_mag.device_id", "vehicle_magnetometer.device_id"),
        "barometer": ("sensor_baro.device_id", "vehicle_air_data.baro_device_id"),
        "GPS": ("sensor_gps.device_id", "vehicle_gps_position.device_id"),
        "range finder": ("distance_sensor.device_id",),
        "optical flow": ("sensor_optical_flow.device_id", "vehicle_optical_flow.device_id"),
        "airspeed sensor": ("differential_pressure.device_id",),
    }
)
"""The fields with the ids of the devices of a kind. The first ones are those of all devices, others of those in use."""
TOPICS = frozenset({path.partition(".")[0] for paths in _FIELDS.values() for path in paths} | {_INFORMATION})
"""The topics that tell devices."""
_IMU = "accelerometer", "gyroscope"
_CALIBRATION = re.compile(r"CAL_(ACC|GYRO|MAG|BARO)\d_ID")
_CALIBRATED: Mapping[str, str] = MappingProxyType(
    {"ACC": "accelerometer", "GYRO": "gyroscope", "MAG": "magnetometer", "BARO": "barometer"}
)
_MOST = 16
"""The devices of a kind. PX4 has at most 4 sensors of most kinds."""


class Device(NamedTuple):
    """A device that gives samples of one kind or of several."""

    kinds: tuple[str, ...]
    """What it measures: `accelerometer`, `gyroscope`."""
    model: str
    """`ICM42688P`."""
    bus: str
    """`SPI 1, 0x01`."""
    calibrations: tuple[str, ...]
    """What the parameters with its calibrations begin with: `CAL_ACC0`, `CAL_GYRO0`."""
    is_seen: bool
    """Whether a topic has samples of it. If not, only its calibration is known."""
    about: str = ""
    """Its name, versions and serial number, if the recording tells them."""

    @property
    def kind(self) -> str:
        """What it measures, in words."""
        return "IMU" if self.kinds == _IMU else ", ".join(self.kinds)

    @property
    def state(self) -> str:
        """Its calibrations, and whether the recording has no samples of it."""
        return ", ".join((*self.calibrations, *(() if self.is_seen else ("no samples",))))


def devices_of(recorded: Recorded) -> list[Device]:
    """Return the devices of a vehicle, in the order of their kinds."""
    calibrated, about = _calibrations(recorded.log.parameters), _about(recorded)
    kinds: dict[int, list[str]] = {}
    seen = set()
    for kind, paths in _FIELDS.items():
        used = list(dict.fromkeys(number for path in paths for number in _numbers(recorded, path)))[:_MOST]
        seen.update(used)
        for number in dict.fromkeys((*used, *calibrated.get(kind, {}))):
            kinds.setdefault(number, []).append(kind)
    return [
        Device(
            tuple(of_one),
            *device_id(number),
            tuple(name for kind in of_one if (name := calibrated.get(kind, {}).get(number))),
            number in seen,
            about.get(number, ""),
        )
        for number, of_one in kinds.items()
    ]


def _numbers(recorded: Recorded, path: str) -> Iterator[int]:
    """Yield the ids in a field of each instance of a topic, without those of no device."""
    topic, _, field = path.partition(".")
    for instance in recorded.instances(topic):
        column = recorded.column(topic, field, instance)
        if column is not None:
            yield from (int(each) for each in distinct(column.finite)[: _MOST + 1] if 0 < each < 1 << 32)


def _calibrations(parameters: Mapping[str, int | float]) -> dict[str, dict[int, str]]:
    """Return the names of calibrations by the kinds and ids of devices, as they are in the parameters."""
    found: dict[str, dict[int, str]] = {}
    for name, value in parameters.items():
        match = _CALIBRATION.fullmatch(name)
        if match and isinstance(value, int) and value:
            found.setdefault(_CALIBRATED[match[1]], {}).setdefault(value & 0xFFFF_FFFF, name.removesuffix("_ID"))
    return found


def _about(recorded: Recorded) -> dict[int, str]:
    """Return names, versions and serial numbers of devices by their ids."""
    found: dict[int, str] = {}
    samples = recorded.samples(_INFORMATION)
    names = () if samples is None else samples.array.dtype.names or ()
    if samples is None or "device_id" not in names:
        return found
    _, firsts = np.unique(samples.array["device_id"], return_index=True)
    for row in samples.array[np.sort(firsts)[: _MOST * _MOST]]:
        labels = {"name": "", "hardware_version": "hardware ", "firmware_version": "firmware ", "serial_number": "no. "}
        parts = (f"{label}{text}" for name, label in labels.items() if name in names and (text := _text(row[name])))
        found[int(row["device_id"])] = ", ".join(parts)
    return found


def _text(value: Any) -> str:
    return bytes(value).partition(b"\0")[0].decode(errors="replace").strip()
