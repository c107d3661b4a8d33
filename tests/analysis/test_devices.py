"""Tests of the table of devices: device ids as PX4 packs them, from topics and calibrations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from msggen import recordings
from msggen.analysis.devices import TOPICS, Device, devices_of
from msggen.analysis.flight import flight_of
from msggen.messages.devices import device_id
from support.ulog import UlogWriter
from support.written import write_recording


@pytest.mark.parametrize(
    ("number", "model", "bus"),
    [
        (1310988, "simulated IMU", "simulation 1, 0x01"),  # of a real PX4 v1.18 in its simulator
        (6620172, "simulated barometer", "simulation 1, 0x04"),
        (197388, "simulated magnetometer", "simulation 1, 0x03"),
        (0x26_10_0A, "ICM42688P", "SPI 1, 0x10"),
        (0x06_0E_09, "IST8310", "I2C 1, 0x0e"),
        (0x88_7D_03, "DroneCAN device", "DroneCAN 0, node 125"),
        (0xA5_00_1D, "u-blox", "serial 3, 0x00"),
        (0xFE_00_07, "type 0xfe", "unknown bus 0, 0x00"),
        (0, "type 0x00", "unknown bus 0, 0x00"),
    ],
)
def test_a_device_id_has_type_bus_and_address(number: int, model: str, bus: str) -> None:
    assert device_id(number) == (model, bus)


def devices_in(path: Path | str) -> list[Device]:
    with recordings.open(str(path)) as log:
        return devices_of(flight_of(log, lambda name: name in TOPICS).recorded)


def test_devices_are_those_in_topics(tmp_path: Path, px4_types: Any) -> None:
    about = px4_types.DeviceInformation(
        device_id=0x06_0E_09,
        name=b"compass".ljust(80, b"\0"),
        firmware_version=b"1.2".ljust(24, b"\0"),
        serial_number=b"<7>".ljust(33, b"\0"),
    )
    samples = [
        (
            "/fmu/out/vehicle_imu_status",
            0.0,
            px4_types.VehicleImuStatus(accel_device_id=0x26_10_0A, gyro_device_id=0x26_10_0A),
        ),
        ("/fmu/out/sensor_mag", 0.1, px4_types.SensorMag(device_id=0x06_0E_09)),
        ("/fmu/out/vehicle_magnetometer", 0.2, px4_types.VehicleMagnetometer(device_id=0x06_0E_09)),
        ("/fmu/out/sensor_gps", 0.3, px4_types.SensorGps(device_id=0)),
        ("/fmu/out/device_information", 0.4, about),
        ("/fmu/out/device_information", 0.5, about),
    ]
    imu, compass = devices_in(write_recording(tmp_path / "devices.mcap", samples))
    assert tuple(imu) == (("accelerometer", "gyroscope"), "ICM42688P", "SPI 1, 0x10", (), True, "")
    assert imu.kind == "IMU"
    assert (compass.kind, compass.model, compass.about) == ("magnetometer", "IST8310", "compass, firmware 1.2, no. <7>")


def test_calibrated_devices_without_samples_are_told(tmp_path: Path) -> None:
    writer = UlogWriter(start=0)
    for name, value in (("CAL_MAG0_ID", 0x06_0E_09), ("CAL_MAG1_ID", 0), ("CAL_GYRO1_ID", -2), ("CAL_ACC0_ID", 1.5)):
        writer.parameter(name, value)
    found = devices_in(writer.write(tmp_path / "calibrated.ulg"))
    assert [(each.kind, each.bus, each.state) for each in found] == [
        ("gyroscope", "MAVLink 31, 0xff", "CAL_GYRO1, no samples"),
        ("magnetometer", "I2C 1, 0x0e", "CAL_MAG0, no samples"),
    ]


def test_thousands_of_ids_are_few_devices(tmp_path: Path, px4_types: Any) -> None:
    samples = [("/fmu/out/sensor_mag", step / 1e3, px4_types.SensorMag(device_id=step)) for step in range(3000)]
    assert len(devices_in(write_recording(tmp_path / "many.mcap", samples))) == 16
