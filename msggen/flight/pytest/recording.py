"""The ULog of a simulated flight."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from importlib import import_module
from types import ModuleType
from typing import Any

from msggen.sim import Options
from msggen.sim.disturbances import noise_with
from msggen.sim.publishing import Schedule, publication_of
from msggen.sim.ulog import UlogWriter, Vehicle
from msggen.sim.values import Clocks, Scene
from msggen.sim.world import World

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
_INTERVAL = 100_000
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
        self._schedule = Schedule([each._replace(interval=max(each.pause, _INTERVAL)) for each in out], start)
        self._noise = noise_with(options.disturbances, options.seed, options.key)
        self._state = ""

    def observe(self, world: World, now: int) -> None:
        """Write what is due at a time in us."""
        state = world.state(was_armed=False)
        if state != self._state:
            self._state = state
            self._writer.text(now, state)
        scene = Scene(world, self._noise, Clocks())
        for publication in self._schedule.take(now):
            message = publication.filler.make(scene, now)
            if message is not None:
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
