"""What a device id of PX4 says: the bus that a sensor is on, its address there, and its type.

The layout is that of `DeviceStructure` in src/lib/drivers/device/Device.hpp of PX4-Autopilot, the types are the
DEVTYPE numbers of src/drivers/drv_sensor.h.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

_DRONECAN: Final = 3
_BUSES: Final[Mapping[int, str]] = MappingProxyType(
    {1: "I2C", 2: "SPI", _DRONECAN: "DroneCAN", 4: "simulation", 5: "serial", 6: "MAVLink"}
)
_MODELS: Final[Mapping[int, str]] = MappingProxyType(
    {
        0x01: "HMC5883",
        0x03: "simulated magnetometer",
        0x04: "AK8963",
        0x05: "LIS3MDL",
        0x06: "IST8310",
        0x07: "RM3100",
        0x08: "QMC5883L",
        0x09: "AK09916",
        0x0A: "VCM1193L",
        0x0B: "IST8308",
        0x0D: "MMC5983MA",
        0x0E: "IIS2MDC",
        0x0F: "QMC5883P",
        0x11: "LSM303D",
        0x12: "LSM6DSV",
        0x14: "simulated IMU",
        0x15: "simulated airspeed sensor",
        0x16: "simulated flow sensor",
        0x21: "MPU6000",
        0x22: "L3GD20",
        0x24: "MPU9250",
        0x25: "ICM20649",
        0x26: "ICM42688P",
        0x27: "ICM40609D",
        0x28: "ICM20948",
        0x29: "ICM42605",
        0x2A: "ICM42670P",
        0x2B: "IIM42652",
        0x2C: "IAM20680HP",
        0x2D: "ICM42686P",
        0x2E: "IIM42653",
        0x31: "MB12xx",
        0x32: "LL40LS",
        0x33: "MPU6050",
        0x34: "ICM45686",
        0x35: "MPU6050",
        0x36: "MPU6500",
        0x37: "BMI270",
        0x38: "ICM20602",
        0x3A: "ICM20608G",
        0x3C: "ICM20689",
        0x3D: "MS5611",
        0x3E: "MS5607",
        0x3F: "BMP280",
        0x40: "LPS25H",
        0x41: "BMI055",
        0x42: "BMI055",
        0x43: "BMM150",
        0x44: "LSM9DS1",
        0x45: "LSM9DS1",
        0x46: "ETS3",
        0x47: "MS4515",
        0x48: "MS4525DO",
        0x49: "MS5525DSO",
        0x4A: "SDP31",
        0x4B: "SDP32",
        0x4C: "SDP33",
        0x4D: "TCBP001TA",
        0x4E: "MS5837",
        0x4F: "SPL06",
        0x50: "LPS33HW",
        0x51: "MPL3115A2",
        0x52: "FXOS8701C",
        0x54: "FXAS2100C",
        0x57: "ADIS16448",
        0x58: "ADIS16470",
        0x59: "ADIS16477",
        0x5A: "ADIS16507",
        0x5B: "SCH16T",
        0x5C: "ADIS16607",
        0x5D: "ADIS1650x",
        0x5F: "MPC2520",
        0x60: "LPS22HB",
        0x61: "LSM303AGR",
        0x62: "LSM303AGR",
        0x63: "ADIS16497",
        0x65: "simulated barometer",
        0x66: "BMI088",
        0x67: "BMP388",
        0x68: "DPS310",
        0x6A: "BMI088",
        0x6C: "BMI085",
        0x6D: "BMI085",
        0x6E: "BMP390",
        0x6F: "BMP581",
        0x70: "LL40LS",
        0x71: "MappyDot",
        0x72: "MB12xx",
        0x73: "LightWare laser",
        0x74: "SRF02",
        0x75: "TeraRanger",
        0x76: "VL53L0X",
        **dict.fromkeys(range(0x80, 0x8B), "DroneCAN device"),
        0x91: "VL53L1X",
        0x92: "CM8JL65",
        0x93: "LeddarOne",
        0x94: "over MAVLink",
        0x95: "PGA460",
        0x96: "PX4Flow",
        0x97: "TFmini",
        0x98: "uLanding",
        0x99: "AFBR-S50",
        0x9A: "simulated range finder",
        0x9B: "SRF05",
        0x9C: "GY-US42",
        0xA0: "Ashtech",
        0xA1: "Emlid Reach",
        0xA2: "Femtomes",
        0xA3: "MTK",
        0xA4: "Septentrio (SBF)",
        0xA5: "u-blox",
        0xA6: "u-blox 6",
        0xA7: "u-blox 7",
        0xA8: "u-blox 8",
        0xA9: "u-blox 9",
        0xAA: "u-blox F9P",
        0xAB: "NMEA",
        0xAC: "u-blox 10",
        0xAD: "u-blox 20",
        0xAF: "simulated GPS",
        0xB1: "SHT3x",
        0xB2: "over MAVLink",
        0xB3: "PMW3901",
        0xB4: "PAW3902",
        0xB5: "PX4Flow",
        0xB6: "PAA3905",
        0xB7: "ICP101xx",
        0xB8: "ICP201xx",
        0xE0: "TF02 Pro",
        0xE1: "VN-100",
        0xE2: "VN-200",
        0xE3: "VN-300",
        0xE4: "ASP5033",
        0xE5: "BMM350",
        0xE6: "AUAV",
        0xE7: "AUAV",
        0xE8: "SPA06",
        0xE9: "Inertial Labs",
        0xEA: "MicroStrain",
        0xEB: "BAHRS",
        0xEC: "SBG",
    }
)
"""What sensors are called, by the number of their type: only those that give samples to topics with device ids."""


class DeviceId(NamedTuple):
    """What is in a device id."""

    model: str
    """`ICM42688P`, or `type 0x42` for one that is not known."""
    bus: str
    """Where it is: `I2C 1, 0x0e`, `DroneCAN 0, node 42`."""


def device_id(number: int) -> DeviceId:
    """Return what a device id says.

    Bits 0 to 2 are the kind of the bus, 3 to 7 its number, 8 to 15 the address, and 16 to 23 the type.
    """
    kind, address, type_ = number & 7, number >> 8 & 0xFF, number >> 16 & 0xFF
    place = f"node {address}" if kind == _DRONECAN else f"0x{address:02x}"
    bus = f"{_BUSES.get(kind, 'unknown bus')} {number >> 3 & 31}, {place}"
    return DeviceId(_MODELS.get(type_, f"type 0x{type_:02x}"), bus)
