"""Which setpoints a vehicle follows in the mode of a program, and the errors of those that it does not follow."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, Final

from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.feeds import Topics
from msggen.flight.states import is_in_transition, is_on_wings, title_of, types_of
from msggen.messages import setpoints
from msggen.messages.setpoints import Kind
from msggen.messages.vehicle_types import TITLES

_WAYS: Final = (
    ((setpoints.GOTO, setpoints.TRAJECTORY), "`goto` and `trajectory` fly it"),
    ((setpoints.FIXED_WING,), "`goto` and `fixed_wing` fly it"),
    (setpoints.ROVER, "`goto` and `rover` drive it"),
)
"""The kinds that a mode of a vehicle declares, if its firmware takes them."""
_GROUPS: Final = MappingProxyType({"ROVER": setpoints.ROVER, "ROVER_THROTTLE": setpoints.ROVER_THROTTLE})
_NAMES: Final = MappingProxyType(
    {value: name for name, value in vars(setpoints).items() if isinstance(value, Kind) and name.isupper()}
)
"""The names of kinds in programs, and of those that belong together."""
_NO_TRANSITION: Final = (
    "the VTOL changes between hovering and forward flight, and the mode does not declare TRAJECTORY and FIXED_WING"
)
NOW_FLIES: Final = MappingProxyType({True: "the VTOL flies on its wings now", False: "the VTOL hovers now"})


def check_kinds(name: str, kinds: Sequence[Kind], status: Any, topics: Topics) -> None:
    """Raise UnsupportedError for kinds of setpoints that the vehicle of a VehicleStatus or its firmware never takes."""
    for kind in kinds:
        if status is not None and types_of(status).isdisjoint(kind.followed_by):
            raise _unfollowed(name, kind, status, topics)
        topics.check_takes(kind)


def check_follows(name: str, kind: Kind, status: Any, topics: Topics) -> None:
    """Raise UnsupportedError for a setpoint that a vehicle never follows, and FlightError for one that it does not now.

    What a VTOL follows depends on whether it flies on its wings.
    """
    if status is None:
        return
    if types_of(status).isdisjoint(kind.followed_by):
        raise _unfollowed(name, kind, status, topics)
    if is_in_transition(status) and kind.is_placed:
        raise FlightError(
            f"mode {name!r}: the VTOL changes between hovering and forward flight: wait for the end, as "
            "`await self.to_fixed_wing()` and `await self.to_multicopter()` do"
        )
    if status.vehicle_type not in kind.followed_by:
        how = "to_multicopter" if is_on_wings(status) else "to_fixed_wing"
        raise FlightError(
            f"mode {name!r}: {NOW_FLIES[is_on_wings(status)]}, and does not follow {kind.name} setpoints: "
            f"`await self.{how}()` before"
        )


def lacks(kinds: Sequence[Kind], status: Any) -> str:
    """Return why a mode with kinds of setpoints cannot fly a VTOL as it flies now, "" if it can."""
    if status is None or not status.is_vtol or not kinds:
        return ""
    if is_in_transition(status):
        both = {setpoints.TRAJECTORY, setpoints.FIXED_WING} <= {*kinds}
        return "" if both or not all(kind.is_placed for kind in kinds) else _NO_TRANSITION
    can_fly = any(status.vehicle_type in kind.followed_by for kind in kinds)
    return "" if can_fly else f"{NOW_FLIES[is_on_wings(status)]}, and the mode declares no setpoints for that"


def check_declared(name: str, kinds: Sequence[Kind], kind: Kind, topics: Topics) -> None:
    """Raise UnsupportedError for a kind of setpoints that a mode does not declare, or the firmware does not take."""
    if kind not in kinds:
        topics.check_takes(kind)
        known = ", ".join(each.name for each in kinds)
        group = next((name for name, each in _GROUPS.items() if kind in each), "")
        added = f"`*{group}`, the kinds of {group}," if group else f"`{_NAMES[kind]}`"
        raise UnsupportedError(f"mode {name!r} declares {known} setpoints: add {added} to its `setpoints`")


def use_for(status: Any, topics: Topics) -> str:
    """Return which kinds of setpoints a mode of a vehicle declares that its firmware takes, for people."""
    types = types_of(status)
    ways = [each for each in _WAYS if not types.isdisjoint(each[0][0].followed_by) and all(map(topics.takes, each[0]))]
    if ways:
        kinds = [kind for each in ways for kind in each[0]]
        return f"declare `setpoints = {_spelled(kinds)}`: {ways[0][1] if len(ways) == 1 else '`goto` flies it'}"
    taken = [each for each in setpoints.SENT if not types.isdisjoint(each.followed_by) and topics.takes(each)]
    return f"this firmware takes only `setpoints = {_spelled(taken)}`"


def _spelled(kinds: Sequence[Kind]) -> str:
    """Return kinds as in a program."""
    for name, each in _GROUPS.items():
        if tuple(kinds) == each:
            return name
    names = ", ".join(_NAMES[each] for each in kinds)
    return f"({names},)" if len(kinds) == 1 else f"({names})"


def _unfollowed(name: str, kind: Kind, status: Any, topics: Topics) -> UnsupportedError:
    whose = " and ".join(TITLES[each] for each in sorted(kind.followed_by))
    title = title_of(status)
    return UnsupportedError(
        f"mode {name!r}: {title} does not follow {kind.name} setpoints, which are for {whose}. For {title}, "
        f"{use_for(status, topics)}"
    )
