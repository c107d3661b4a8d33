"""Names of topics: `/uav_1/fmu/out/vehicle_status_v1` has a namespace, a stem and a version."""

from __future__ import annotations

import re

_VERSION = re.compile("_v([0-9]+)$")


def stem_of(ros_name: str) -> str:
    """Return the name without the version of the message: `/fmu/out/vehicle_status`."""
    return _VERSION.sub("", ros_name)


def uorb_name(name: str) -> str:
    """Return the name in uORB of the topic with a name in ROS 2: `vehicle_status` for `/fmu/out/vehicle_status_v1`."""
    return stem_of(name).rpartition("/")[2]


def version_of(ros_name: str) -> int:
    """Return the version of the message in a name, 0 without a suffix (docs/wire.md, section 11)."""
    found = _VERSION.search(ros_name)
    return int(found[1]) if found else 0


def is_named_after(ros_name: str, message: str) -> bool:
    """Whether a topic is named after a message: `vehicle_command` after VehicleCommand (docs/wire.md, section 1)."""
    return stem_of(ros_name).rpartition("/")[2].replace("_", "") == message.lower()


def is_topic(ros_name: str, stem: str, namespace: str | None = None) -> bool:
    """Whether a name is that of a topic, in any version, and in `namespace`, or in any if it is None."""
    plain = stem_of(ros_name)
    if namespace is None:
        return plain.endswith(stem)
    return plain == f"/{namespace}{stem}" if namespace else plain == stem


def without_namespace(ros_name: str, namespace: str) -> str:
    """Return the name without the namespace of the vehicle."""
    front = f"/{namespace}" if namespace else ""
    return ros_name[len(front) :] if ros_name.startswith(f"{front}/") else ros_name
