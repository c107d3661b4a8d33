"""Which setpoints a vehicle follows in the mode of a program, and the errors of those that it does not follow."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, Final

from msggen.flight.errors import FlightError, UnsupportedError
from msggen.flight.states import is_in_transition, is_on_wings, title_of, types_of
from msggen.messages import setpoints
from msggen.messages.setpoints import Kind
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, ROVER, TITLES

_INSTEAD: Final = MappingProxyType(
    {
        ROTARY_WING: "`setpoints = (GOTO, TRAJECTORY)`: `goto` and `trajectory` fly it",
        FIXED_WING: "`setpoints = (FIXED_WING,)`: `goto` and `fixed_wing` fly it",
        ROVER: "`setpoints = ROVER`: `goto` and `rover` drive it",
    }
)
"""What a mode of each type of vehicle uses."""
_GROUPS: Final = MappingProxyType({"ROVER": setpoints.ROVER, "ROVER_THROTTLE": setpoints.ROVER_THROTTLE})
_NAMES: Final = MappingProxyType(
    {value: name for name, value in vars(setpoints).items() if isinstance(value, Kind) and name.isupper()}
)
"""The names of kinds in programs, and of those that belong together."""
NOW_FLIES: Final = MappingProxyType({True: "the VTOL flies on its wings now", False: "the VTOL hovers now"})


def check_kinds(name: str, kinds: Sequence[Kind], status: Any) -> None:
    """Raise UnsupportedError for a mode with kinds of setpoints that the vehicle of a VehicleStatus never follows."""
    for kind in kinds:
        if status is not None and types_of(status).isdisjoint(kind.followed_by):
            raise _unfollowed(name, kind, status)


def check_follows(name: str, kind: Kind, status: Any) -> None:
    """Raise UnsupportedError for a setpoint that a vehicle never follows, and FlightError for one that it does not now.

    What a VTOL follows depends on whether it flies on its wings.
    """
    if status is None:
        return
    if types_of(status).isdisjoint(kind.followed_by):
        raise _unfollowed(name, kind, status)
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


def check_declared(name: str, kinds: Sequence[Kind], kind: Kind) -> None:
    """Raise UnsupportedError for a kind of setpoints that a mode does not declare."""
    if kind not in kinds:
        known = ", ".join(each.name for each in kinds)
        group = next((name for name, each in _GROUPS.items() if kind in each), "")
        added = f"`*{group}`, the kinds of {group}," if group else f"`{_NAMES[kind]}`"
        raise UnsupportedError(f"mode {name!r} declares {known} setpoints: add {added} to its `setpoints`")


def _unfollowed(name: str, kind: Kind, status: Any) -> UnsupportedError:
    whose = " and ".join(TITLES[each] for each in sorted(kind.followed_by))
    use = _INSTEAD.get(status.vehicle_type)
    instead = f". For {TITLES[status.vehicle_type]}, declare {use}" if use and not status.is_vtol else ""
    return UnsupportedError(
        f"mode {name!r}: {title_of(status)} does not follow {kind.name} setpoints, which are for {whose}{instead}"
    )
