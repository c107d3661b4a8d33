"""What can happen to a simulated vehicle while it flies, as texts such as `no-position` and `battery=0.1`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from msggen.base.diagnostics import suggestion
from msggen.messages.commands import ACCEPTED, SET_NAV_STATE
from msggen.messages.nav_states import MODE_NAMES
from msggen.sim.battery import NEW, WORN
from msggen.sim.commands import SIMULATED
from msggen.sim.world import World

NO_LINK: Final = "no-link"
LINK: Final = "link"
RESTART: Final = "restart"
RESTART_CLIENT: Final = "restart-client"
_PILOT: Final = 1
"""The source component of what a pilot selects: COMPONENT_AUTOPILOT."""
_MODES: Mapping[str, int] = {name.replace(" ", "-"): mode for mode, name in MODE_NAMES.items() if mode in SIMULATED}


class Fault(NamedTuple):
    """Something that happens."""

    text: str
    """What it is called."""
    change: Callable[[World], str] | None = None
    """Lets it happen to the world, and returns a line for people. None for what happens to the client."""


def _set(text: str, **values: bool) -> Callable[[World], str]:
    """Return what sets attributes of the world."""

    def change(world: World) -> str:
        vars(world).update(values)
        return text

    return change


def _wear(text: str, resistance: float) -> Callable[[World], str]:
    """Return what sets the resistance of the battery."""

    def change(world: World) -> str:
        world.battery.resistance = resistance
        return text

    return change


def _sticks(text: str, *, are_there: bool) -> Callable[[World], str]:
    """Return what connects or disconnects the pilot's sticks, which the commander sees at once."""

    def change(world: World) -> str:
        world.has_sticks = are_there
        world.commander.senses = world.senses
        return text

    return change


def _battery(text: str) -> Callable[[World], str]:
    """Return what leaves a share of the charge in the battery."""
    try:
        share = float(text)
    except ValueError:
        share = math.nan
    if not 0.0 <= share <= 1.0:
        raise ValueError(f"'battery={text}': expected a share from 0 to 1, as in 'battery=0.1'")

    def change(world: World) -> str:
        world.battery.remaining = share
        return f"the battery has {share:.0%} left"

    return change


def _mode(text: str) -> Callable[[World], str]:
    """Return what selects a mode, as a pilot does with the switch."""
    if text not in _MODES:
        raise ValueError(f"'mode={text}': no such mode{suggestion(text, _MODES)}: there are {', '.join(_MODES)}")
    return lambda world: choose(world, _MODES[text], text)


def choose(world: World, mode: int, name: str) -> str:
    """Let a pilot select a mode with the switch, and return a line for people."""
    result = world.command(SET_NAV_STATE, (mode, *[math.nan] * 6), _PILOT)
    answer = "" if result == ACCEPTED else f", which is refused: {world.reason}"
    return f"the pilot selects {name}{answer}"


_PLAIN: Mapping[str, Callable[[World], str] | None] = {
    "no-position": _set("the position is lost", has_position=False, has_gps=False),
    "position": _set("the position is there again", has_position=True, has_gps=True),
    "no-gps": _set("GPS is lost", has_gps=False),
    "gps": _set("GPS is there again", has_gps=True),
    "disturbed-compass": _set("the magnetic field is disturbed", is_compass_disturbed=True),
    "compass": _set("the magnetic field is calm again", is_compass_disturbed=False),
    "weak-battery": _wear("the battery is worn out", WORN),
    "new-battery": _wear("the battery is as new again", NEW),
    "sticks": _sticks("the pilot's sticks are there", are_there=True),
    "no-sticks": _sticks("the pilot's sticks are gone", are_there=False),
    NO_LINK: None,
    LINK: None,
    RESTART: None,
    RESTART_CLIENT: None,
}
_WITH_VALUE: Mapping[str, Callable[[str], Callable[[World], str]]] = {"battery": _battery, "mode": _mode}
NAMES: Final = (*_PLAIN, "battery=SHARE", "mode=MODE")


def read_fault(text: str) -> Fault:
    """Return the fault that a text names. Raises ValueError, which tells what is wrong."""
    if text in _PLAIN:
        return Fault(text, _PLAIN[text])
    name, _, value = text.partition("=")
    if name in _WITH_VALUE:
        return Fault(text, _WITH_VALUE[name](value))
    near = suggestion(text, (*_PLAIN, *_WITH_VALUE))
    raise ValueError(f"no fault '{text}'{near}: there are {', '.join(NAMES)}")


class TimedFaults:
    """Faults at times in s after a start."""

    def __init__(self, faults: Sequence[tuple[float, str]]) -> None:
        """Take times and texts. Raises ValueError for a text that names no fault."""
        found = ((round(time * 1e6), read_fault(text)) for time, text in faults)
        self._waiting = deque(sorted(found, key=lambda each: each[0]))

    @property
    def next_time(self) -> int | None:
        """The time of the next one, in us after the start."""
        return self._waiting[0][0] if self._waiting else None

    def take(self, elapsed: int) -> Iterator[Fault]:
        """Yield those that are due at a time in us after the start."""
        while self._waiting and self._waiting[0][0] <= elapsed:
            yield self._waiting.popleft()[1]
