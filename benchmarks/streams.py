"""Compares decode and encode with rosbags, for messages with strings and sequences.

    pip install -e '.[test]' && python benchmarks/streams.py

Both take turns in one run, and the shortest turn counts. Their bytes and values are compared first.
"""

from __future__ import annotations

import sys
import tempfile
import timeit
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from msggen.generate.python.package import render_package
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources

TURNS, CALLS = 60, 100

DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/msg/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/msg/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\nPose pose\n",
    "nav_msgs/msg/Path": "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
    "sensor_msgs/msg/LaserScan": "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\n"
    "float32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
    "float32[] ranges\nfloat32[] intensities\n",
    "sensor_msgs/msg/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    "float64[] effort\n",
    "diagnostic_msgs/msg/KeyValue": "string key\nstring value\n",
    "diagnostic_msgs/msg/DiagnosticStatus": "byte level\nstring name\nstring message\nstring hardware_id\n"
    "KeyValue[] values\n",
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header\nDiagnosticStatus[] status\n",
}


def generated() -> Any:
    """Return the package that msggen generates from DEFINITIONS."""
    folder = Path(tempfile.mkdtemp())
    for name, text in DEFINITIONS.items():
        path = folder / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    packages = sorted({name.split("/")[0] for name in DEFINITIONS})
    catalog = read_catalog(find_sources(None, tuple(f"{package}={folder / package}" for package in packages)))
    for name, text in render_package(catalog, "ros").items():
        path = folder / "ros" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    sys.path.insert(0, str(folder))
    return import_module("ros")


def samples(ros: Any) -> dict[str, Any]:
    """Return a message of each kind by its name in the table."""
    sensor, diagnostic, geometry = ros.sensor_msgs.msg, ros.diagnostic_msgs.msg, ros.geometry_msgs.msg
    header = ros.std_msgs.msg.Header(ros.builtin_interfaces.msg.Time(1, 2), "base_link")
    pose = geometry.PoseStamped(header, geometry.Pose(geometry.Point(1.0, 2.0, 3.0)))
    entries = [diagnostic.KeyValue("key", "value")] * 8
    return {
        "PoseStamped": pose,
        "LaserScan of 360": sensor.LaserScan(header, ranges=[1.0] * 360, intensities=[2.0] * 360),
        "JointState of 6": sensor.JointState(header, ["joint"] * 6, [1.0] * 6, [2.0] * 6, [3.0] * 6),
        "Path of 50": ros.nav_msgs.msg.Path(header, [pose] * 50),
        "DiagnosticArray of 4 by 8": diagnostic.DiagnosticArray(
            header, [diagnostic.DiagnosticStatus(1, "name", "all is well", "hardware", entries)] * 4
        ),
    }


def least(functions: list[Callable[[], object]]) -> list[float]:
    """Return the shortest time of a call of each in microseconds, taking turns."""
    found = [float("inf")] * len(functions)
    for _ in range(TURNS):
        for index, function in enumerate(functions):
            found[index] = min(found[index], timeit.timeit(function, number=CALLS) / CALLS * 1e6)
    return found


def main() -> None:
    """Measure and print a table."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    table = Table(*("message", "bytes", "decode us", "of rosbags", "encode us", "of rosbags"))
    for name, message in samples(generated()).items():
        sample, type_name = message.encode(), message.__msg__.ros_type
        mine, theirs = type(message).decode(sample), store.deserialize_cdr(sample, type_name)
        if mine != message or bytes(store.serialize_cdr(theirs, type_name)) != sample:
            raise SystemExit(f"{name}: the two differ")
        functions = [
            partial(type(message).decode, sample),
            partial(store.deserialize_cdr, sample, type_name),
            mine.encode,
            partial(store.serialize_cdr, theirs, type_name),
        ]
        decode, peer_decode, encode, peer_encode = least(functions)
        figures = (f"{decode:.1f}", f"{decode / peer_decode:.2f}", f"{encode:.1f}", f"{encode / peer_encode:.2f}")
        table.add_row(name, str(len(sample)), *figures)
    Console().print(table)


if __name__ == "__main__":
    main()
