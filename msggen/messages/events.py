"""Events of PX4: their ids and arguments, and the components whose health it reports."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Final

from msggen.base.diagnostics import suggestion

SIZE: Final = 25
"""The bytes of the arguments of an event: `arguments` in Event.msg."""
COMPONENT: Final = 4
"""The byte of an arming check's event that has the component. PX4 writes the modes into those before it."""
OWN: Final = COMPONENT + 1
"""The first byte of an arming check's event that its own arguments can use."""
CODES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "uint8_t": "B",
        "int8_t": "b",
        "uint16_t": "H",
        "int16_t": "h",
        "uint32_t": "I",
        "int32_t": "i",
        "uint64_t": "Q",
        "int64_t": "q",
        "float": "f",
    }
)
"""The types of arguments by their names in event metadata, as `struct` names them."""


class Component(IntEnum):
    """The components whose health PX4 reports to ground stations: `health_component_t` of its event metadata."""

    NONE = 0
    ABSOLUTE_PRESSURE = 1
    DIFFERENTIAL_PRESSURE = 2
    GPS = 3
    OPTICAL_FLOW = 4
    VISION_POSITION = 5
    DISTANCE_SENSOR = 6
    REMOTE_CONTROL = 7
    MOTORS_ESCS = 8
    UTM = 9
    LOGGING = 10
    BATTERY = 11
    COMMUNICATION_LINKS = 12
    RATE_CONTROLLER = 13
    ATTITUDE_CONTROLLER = 14
    POSITION_CONTROLLER = 15
    ATTITUDE_ESTIMATE = 16
    LOCAL_POSITION_ESTIMATE = 17
    MISSION = 18
    AVOIDANCE = 19
    SYSTEM = 20
    CAMERA = 21
    GIMBAL = 22
    PAYLOAD = 23
    GLOBAL_POSITION_ESTIMATE = 24
    STORAGE = 25
    PARACHUTE = 26
    MAGNETOMETER = 27
    ACCEL = 28
    GYRO = 29
    OPEN_DRONE_ID = 30
    TRAFFIC_AVOIDANCE = 31


def event_id(name: str) -> int:
    """Return the id of an event from its name: the lower 24 bits of the FNV-1a hash, and component 1."""
    found = 0x811C9DC5
    for octet in name.encode():
        found = (found ^ octet) * 0x01000193 & 0xFFFFFFFF
    return found & 0xFFFFFF | 1 << 24


def packed(arguments: Iterable[tuple[str, float]]) -> bytes:
    """Return the own arguments of an arming check's event as bytes. Each has a type, such as `uint8_t`, and a value.

    Raises TypeError for what are no such pairs, and ValueError for a type that events do not have, a value that does
    not fit into it, and more than 20 bytes.
    """
    found = b""
    for each in arguments:
        if not (isinstance(each, tuple) and len(each) == 2):  # noqa: PLR2004 - a type and a value
            raise TypeError(f'expected pairs as arguments of an event, such as (("float", 0.2),), got {each!r}')
        kind, value = each
        if kind not in CODES:
            raise ValueError(f"events have no arguments of type {kind!r}{suggestion(str(kind), CODES)}")
        try:
            found += struct.pack(f"<{CODES[kind]}", value)
        except (struct.error, OverflowError):
            raise ValueError(f"expected {kind} as an argument of an event, got {value!r}") from None
    if len(found) > SIZE - OWN:
        raise ValueError(f"the arguments have {len(found)} bytes: {SIZE - OWN} fit into an event")
    return found
