"""Timing: contestants take many short turns, and the minimum of each counts.

Other work on the machine can only make a turn longer. It affects all contestants of a round alike, so ratios of minima
are more reliable than times.
"""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from timeit import Timer
from typing import Any, NamedTuple, TypeVar

Name = TypeVar("Name")

WITH_COLLECTOR = "__import__('gc').enable()"
"""Setup of a turn: turns the garbage collector on, as it is for users, because timeit turns it off."""


class Contestant(NamedTuple):
    """A statement and the names that it uses."""

    statement: str
    names: Mapping[str, Any]


def race_groups(
    groups: Mapping[str, Mapping[str, Contestant]], rounds: int, turn: float
) -> dict[str, dict[str, float]]:
    """Return the result of `race` for each group. All groups share each round, and so the load of the machine."""
    everybody = {(group, name): entry for group, by_name in groups.items() for name, entry in by_name.items()}
    best = race(everybody, rounds, turn)
    return {group: {name: best[group, name] for name in by_name} for group, by_name in groups.items()}


def race(contestants: Mapping[Name, Contestant], rounds: int, turn: float) -> dict[Name, float]:
    """Return the shortest time of each statement, in `rounds` rounds of turns of about `turn` seconds."""
    timers = {
        name: Timer(contestant.statement, WITH_COLLECTOR, globals=dict(contestant.names))
        for name, contestant in contestants.items()
    }
    repeats = {name: _repeats(timer, turn) for name, timer in timers.items()}
    best = dict.fromkeys(timers, float("inf"))
    for _ in range(rounds):
        for name, timer in timers.items():
            best[name] = min(best[name], timer.timeit(repeats[name]) / repeats[name])
    return best


def _repeats(timer: Timer, turn: float) -> int:
    """Return the number of times that a statement runs in a turn, at least 1.

    This is based on the shortest of three tries, because a first call may fill caches.
    """
    repeats = 1
    while (took := min(timer.repeat(3, repeats))) < turn / 4:
        repeats *= 2
    return max(1, round(repeats * turn / took))


def race_processes(commands: Mapping[str, Sequence[str]], rounds: int) -> dict[str, float]:
    """Return the shortest wall-clock time of each command. A first round fills the caches.

    `ROUND` in an argument stands for the number of the round, for commands that must start from nothing.
    """
    best = dict.fromkeys(commands, float("inf"))
    for number in range(rounds + 1):
        for name, command in commands.items():
            took = seconds([part.replace("ROUND", str(number)) for part in command])
            best[name] = min(best[name], took) if number else best[name]
    return best


def seconds(command: Sequence[str]) -> float:
    """Run a command with cached bytecode. Return its wall-clock time in seconds."""
    variables = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    started = time.perf_counter()
    subprocess.run(command, check=True, env=variables, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started
