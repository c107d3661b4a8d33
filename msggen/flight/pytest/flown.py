"""The record of a simulated flight, questions about it, and its ULog. Times are in s since boot, places in m in NED."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.messages.nav_states import MODE_NAMES, SELECTABLE, mode_number
from msggen.sim import Options
from msggen.sim.disturbances import noise_with
from msggen.sim.publishing import Schedule, publication_of
from msggen.sim.ulog import UlogWriter, Vehicle
from msggen.sim.values import Clocks, Scene
from msggen.sim.world import World

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_INTERVAL = 20_000
"""The time in us between two places of the track."""
_SETPOINT = "_setpoint"


class Place(NamedTuple):
    """Where the vehicle was. The origin is on the ground below its start."""

    time: float
    north: float
    east: float
    down: float


class ModeChange(NamedTuple):
    """The time at which a mode started to fly: when it was entered, or when the vehicle was armed in it."""

    time: float
    mode: str
    """The name of a PX4 mode in lower case, such as `takeoff`, or the name of a mode of a program."""


class Sent(NamedTuple):
    """A message of a program, even if it was lost on the way."""

    time: float
    topic: str
    message: Any


@dataclass(frozen=True, repr=False)
class Answer:
    """The answer to a question about a flight: true or false, with the reason, which pytest shows."""

    is_true: bool
    text: str

    def __bool__(self) -> bool:
        return self.is_true

    def __repr__(self) -> str:
        return self.text


class Flown:
    """The modes, the track and the messages of a flight."""

    def __init__(self) -> None:
        self._entered: list[ModeChange] = []
        self._places: list[Place] = []
        self._sent: list[Sent] = []
        self._mode: int | None = None
        self._due = 0

    def _observe(self, world: World, now: int) -> None:
        """Record the state of the vehicle at a time in us."""
        mode = world.mode if world.is_armed else None
        if mode not in (None, self._mode):
            self._entered.append(ModeChange(now / 1e6, mode_name(world)))
        self._mode = mode
        if now >= self._due:
            self._due = now + _INTERVAL
            self._places.append(Place(now / 1e6, *world.flight.position))

    @property
    def modes(self) -> list[str]:
        """The names of the modes that were active while the vehicle was armed, one after the other."""
        return [each.mode for each in self._entered]

    @property
    def mode_changes(self) -> list[ModeChange]:
        """The same modes, with the times at which they started."""
        return [*self._entered]

    @property
    def sent(self) -> list[Sent]:
        """The messages that programs have sent."""
        return [*self._sent]

    @property
    def setpoints(self) -> list[Sent]:
        """The setpoints among them."""
        return [each for each in self._sent if each.topic.endswith(_SETPOINT)]

    @property
    def track(self) -> NDArray[np.float64]:
        """Where the vehicle was, every 0.02 s, as rows of a numpy array: time, north, east, down."""
        import numpy as np

        return np.array(self._places, dtype=np.float64).reshape(-1, 4)

    def flown_within(self, radius: float, height: float) -> Answer:
        """Return whether the vehicle stayed within `radius` m of its start, and not higher than `height` m."""

        def outside(place: Place) -> bool:
            return math.hypot(place.north, place.east) > radius or -place.down > height

        found = next(filter(outside, self._places), None)
        farthest = max((math.hypot(each.north, each.east) for each in self._places), default=0.0)
        highest = max((-each.down for each in self._places), default=0.0)
        most = f"{farthest:.1f} m from the start and {highest:.1f} m high"
        if found is not None:
            return Answer(is_true=False, text=f"{most} at most, beyond the limits at {found.time:.2f} s")
        return Answer(is_true=True, text=f"never more than {most}")

    def flown_past(self, *places: Sequence[float], within: float = 1.0) -> Answer:
        """Return whether the vehicle has passed the places in this order: each is north, east and optionally down."""
        begin = 0
        for goal in places:
            near = [_distance(each, goal) for each in self._places[begin:]]
            reached = next((index for index, distance in enumerate(near) if distance <= within), None)
            if reached is None:
                closest = f"{min(near):.1f} m" if near else "nothing"
                return Answer(is_true=False, text=f"no nearer to {tuple(goal)} than {closest}")
            begin += reached
        return Answer(is_true=True, text=f"passed {len(places)} places within {within:g} m")


def _distance(place: Place, goal: Sequence[float]) -> float:
    """Return the distance to a goal, which is north and east, or north, east and down."""
    return math.dist(place[1 : 1 + len(goal)], goal)


def mode_name(world: World) -> str:
    """Return the name of the active mode."""
    own = world.commander.components.modes.get(world.mode)
    return MODE_NAMES[world.mode] if own is None else own.name


def mode_of(world: World, name: str) -> int:
    """Return the nav_state of a mode of PX4 or of a program. Raises ValueError for an unknown name."""
    own = {each.name: number for number, each in world.commander.components.modes.items()}
    found = own.get(name, mode_number(name))
    if found is None:
        raise ValueError(f"expected one of the modes {', '.join([*SELECTABLE, *own])}, got {name!r}")
    return found


_TOPICS = frozenset(
    {
        "airspeed_validated",
        "battery_status",
        "failsafe_flags",
        "home_position",
        "vehicle_attitude",
        "vehicle_global_position",
        "vehicle_land_detected",
        "vehicle_local_position",
        "vehicle_status",
        "vtol_vehicle_status",
        "wind",
    }
)
"""The topics that are recorded at a fixed rate. Messages of programs and their answers are recorded, too."""
_PERIOD = 100_000
"""The time in us between two samples."""


class Recording:
    """A ULog that is written while a vehicle flies. Raises OSError if the file cannot be written."""

    def __init__(self, path: str, package: ModuleType, options: Options, start: int) -> None:
        self.path = path
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with suppress(FileNotFoundError):
            os.unlink(path)  # of an earlier run of the test
        endpoints = import_module(f"{package.__name__}.topics").ENDPOINTS
        topics = {each.uorb_topic: each.message for each in endpoints}
        release = re.sub(r"^px4_v(\d+)_(\d+)$", r"v\1.\2", package.__name__)
        self._writer = UlogWriter(path, start, topics, options.followed, Vehicle(options.key, release))
        out = [
            publication_of(each, parts=options.equipment)
            for each in endpoints
            if each.direction == "out" and each.uorb_topic in _TOPICS
        ]
        self._schedule = Schedule([each._replace(interval=max(each.pause, _PERIOD)) for each in out], start)
        self._noise = noise_with(options.disturbances, options.seed, options.key)
        self._state = ""

    def observe(self, world: World, now: int) -> None:
        """Write what is due at a time in us."""
        state = world.state(was_armed=False)
        if state != self._state:
            self._state = state
            self._writer.text(now, state)
        scene = Scene(world, self._noise, Clocks())
        for publication, message in self._schedule.messages(scene, now):
            self._writer.add(publication.topic, message)

    def add(self, topic: str, message: Any) -> None:
        """Write a message of a program, or an answer to it."""
        if topic not in _TOPICS:
            self._writer.add(topic, message)

    def close(self, *, is_kept: bool) -> None:
        """End the file, and remove it unless it is kept."""
        self._writer.close()
        if not is_kept:
            os.unlink(self.path)
