"""Where captured vehicles of PX4 v1.18 flew and drove, and the setpoints that programs sent them (tests/sim/paths).

`python -m support.captured_paths FOLDER`, in the folder tests, makes those files from the whole captures.
"""

from __future__ import annotations

import gzip
import json
import math
import sys
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from msggen.messages.setpoints import KINDS
from msggen.sim.attitude import Vector
from support import flight_captures
from support.repository import ROOT

FOLDER = ROOT / "tests" / "sim" / "paths"
CAPTURES: Mapping[str, tuple[str, ...]] = {
    "fw-flight": ("fw-flight", "fw-full-rate"),
    "vtol-flight": ("vtol-flight", "vtol-transitions"),
    "vtol-ground": ("vtol-ground",),
    "rover-drive": ("rover-drive",),
}
"""The captures of each flight: some have all samples of a part of it."""
TOPIC = "vehicle_odometry"
"""The topic that tells where a vehicle is."""
_SPACING = 0.2
"""The least time in s between two places."""
_GAP = 1.0
"""The time in s without a setpoint after which a program has paused."""
_STAMPED = 12
"""The bytes before the content of a setpoint: its encapsulation, and its timestamp."""


class Run(NamedTuple):
    """A setpoint that was sent again and again."""

    topic: str
    begin: float
    end: float
    """In s."""
    data: str
    """In hexadecimal digits, encapsulated."""


class Place(NamedTuple):
    """Where a vehicle was, and how it moved. Lengths are in m, angles in degrees."""

    time: float
    """In s."""
    position: Vector
    velocity: Vector
    """North, east and down."""
    angles: Vector
    """Roll, pitch and yaw."""


class Flight(NamedTuple):
    """A captured flight."""

    runs: Sequence[Run]
    places: Sequence[Place]


def names() -> list[str]:
    """Return the names of all flights."""
    return sorted(CAPTURES)


@cache
def load(name: str) -> Flight:
    """Return a flight."""
    content = json.loads(gzip.decompress((FOLDER / f"{name}.json.gz").read_bytes()))
    places = [Place(time, *(_vector(each) for each in vectors)) for time, *vectors in content["places"]]
    return Flight([Run(*each) for each in content["runs"]], places)


def place_of(message: Any, time: float) -> Place:
    """Return the place of a VehicleOdometry."""
    w, x, y, z = message.q
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    angles = math.degrees(roll), math.degrees(pitch), math.degrees(yaw)
    return Place(time, _vector(message.position), _vector(message.velocity), _vector(angles))


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = (round(each, 2) for each in values)
    return x, y, z


# The whole captures


def whole(folder: Path, name: str) -> Flight:
    """Return a flight from the whole captures in a folder."""
    endpoints = {each.ros_name: each for each in import_module("px4_types").topics.ENDPOINTS}
    setpoints = {topic for kind in KINDS for topic in kind.topics}
    wanted = [name for name, each in endpoints.items() if each.uorb_topic in {TOPIC, *setpoints}]
    paths = [folder / f"{each}.json.gz" for each in CAPTURES[name]]
    rows = sorted({row for path in paths for row in flight_captures.samples_of(path, wanted)})
    runs: dict[str, list[Run]] = {}
    places: list[Place] = []
    for time, ros_name, data in rows:
        topic = endpoints[ros_name].uorb_topic
        if topic == TOPIC:
            if not places or time >= places[-1].time + _SPACING:
                places.append(place_of(endpoints[ros_name].message.decode(bytes.fromhex(data)), time))
        else:
            _add(runs.setdefault(topic, []), Run(topic, time, time, data))
    return Flight(sorted((run for each in runs.values() for run in each), key=lambda run: run[1:3]), places)


def _add(runs: list[Run], one: Run) -> None:
    """Add a setpoint: it prolongs the last run if it is the same."""
    last = runs[-1] if runs else None
    if last and last.data[2 * _STAMPED :] == one.data[2 * _STAMPED :] and one.begin < last.end + _GAP:
        runs[-1] = last._replace(end=one.begin)
    else:
        runs.append(one)


def write(folder: Path) -> None:
    """Write the files."""
    FOLDER.mkdir(exist_ok=True)
    for name in names():
        text = json.dumps(whole(folder, name)._asdict(), separators=(",", ":"))
        (FOLDER / f"{name}.json.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))


# Quantities


def nearest(places: Sequence[Place], time: float) -> Place:
    """Return the place at a time in s, or the one after it."""
    return places[min(len(places) - 1, bisect_left(places, time, key=lambda each: each.time))]


QUANTITIES: Mapping[str, Callable[[Place, Place], float]] = {
    "course": lambda now, _: math.degrees(math.atan2(now.velocity[1], now.velocity[0])),
    "speed": lambda now, _: math.hypot(*now.velocity[:2]),
    "climb": lambda now, _: -now.velocity[2],
    "height": lambda now, begin: begin.position[2] - now.position[2],
    "altitude": lambda now, _: -now.position[2],
    "north": lambda now, begin: now.position[0] - begin.position[0],
    "east": lambda now, begin: now.position[1] - begin.position[1],
    "roll": lambda now, _: now.angles[0],
    "heading": lambda now, _: now.angles[2],
}
"""What is compared, of a place and of that at the beginning of its phase: degrees, m and m/s."""
_ANGLES = {"course", "roll", "heading"}


def distance(quantity: str, one: float, other: float) -> float:
    """Return how far apart two values of a quantity are."""
    apart = abs(one - other)
    return min(apart, 360.0 - apart) if quantity in _ANGLES else apart


def farthest(quantity: str, real: Iterable[Place], own: Sequence[Place]) -> tuple[float, float]:
    """Return how far apart two paths come, and when, at the times of the first one."""
    value = QUANTITIES[quantity]
    real = [*real]
    start = nearest(own, real[0].time)
    return max(
        (distance(quantity, value(each, real[0]), value(nearest(own, each.time), start)), each.time) for each in real
    )


if __name__ == "__main__":
    write(Path(sys.argv[1]))
