"""What modes need, and whether they can run.

The masks of PX4's own modes are those that v1.18 reports in FailsafeFlags.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from msggen.messages.nav_states import EXTERNAL
from msggen.messages.refusals import MEANINGS
from msggen.messages.vehicle_types import FIXED_WING, ROTARY_WING, ROVER
from msggen.sim.commander.checks import Reply

OTHER: Final = "other"
"""The requirement that a mode misses that is not registered, does not answer, or says that it cannot run."""
PREVENT_ARMING: Final = "prevent_arming"
STICKS: Final = "manual_control"
_EXTERNAL: Final = sum(1 << mode for mode in EXTERNAL)

OF_PX4: Mapping[str, int] = MappingProxyType(
    {
        "angular_velocity": 0x7ED5FE,
        "attitude": 0x7ED1FE,
        "local_alt": 0x7E01FE,
        "local_position": 0x7A0038,
        "local_position_relaxed": 0x400C4,
        "global_position": 0x38,
        "global_position_relaxed": 0,
        "mission": 0x8,
        "offboard_signal": 0x4000,
        "home_position": 0x20,
        PREVENT_ARMING: 0x3C3020,
        STICKS: 0x8547,
        OTHER: _EXTERNAL,
    }
)
"""The modes that have each requirement, as bits: `mode_req_...` of FailsafeFlags while no program has registered."""
_OF_TYPES: Mapping[int, Mapping[str, int]] = MappingProxyType(
    {
        FIXED_WING: {
            "local_position": 0x380000,
            "local_position_relaxed": 0x4400FC,
            "global_position": 0,
            "global_position_relaxed": 0x38,
        },
        ROVER: {"local_position": 0x780038},
    }
)
"""The masks that differ from them, by the type of the vehicle."""


class Senses(NamedTuple):
    """What the vehicle knows of itself. The defaults are those of a vehicle at rest that has all estimates."""

    angular_velocity: bool = True
    attitude: bool = True
    local_alt: bool = True
    local_position: bool = True
    local_position_relaxed: bool = True
    global_position: bool = True
    global_position_relaxed: bool = True
    home_position: bool = True
    mission: bool = False
    offboard_signal: bool = False
    manual_control: bool = False
    """Whether a pilot's sticks are there."""
    ground_station: bool = False
    battery: int = 0
    """The warning: 0 none, 1 low, 2 critical, 3 emergency."""
    has_fallen: bool = False
    """Whether the vehicle lies on its back or on a side, which PX4's failure detector sees."""
    wings_failed: bool = False
    """Whether a VTOL has given up forward flight: a quad-chute."""
    is_landed: bool = True
    is_done: bool = False
    """Whether PX4's own mode, such as a takeoff, has reached its end."""


class Requirements:
    """The requirements of all modes at a time."""

    def __init__(
        self,
        vehicle_type: int = ROTARY_WING,
        registered: Collection[int] = (),
        verdicts: Iterable[tuple[int, Reply | None]] = (),
        replaced: Mapping[int, int] = MappingProxyType({}),
    ) -> None:
        """Take the type of the vehicle, the modes of programs, their replies, and the internal modes that they replace.

        The reply is None if a mode does not answer, and the mode -1 if a check belongs to none.
        """
        self.masks = {**OF_PX4, **_OF_TYPES.get(vehicle_type, {})}
        self.blocks_arming = False
        """Whether a check that belongs to no mode does not let the vehicle arm."""
        self.masks[OTHER] &= ~sum(1 << mode for mode in registered)
        for mode, reply in verdicts:
            if reply is None:
                self._set(OTHER, mode, None, is_set=True)
            elif mode < 0:
                self.blocks_arming |= not reply.can_run
            else:
                self._take(mode, replaced.get(mode), reply)

    def _take(self, mode: int, replaced: int | None, reply: Reply) -> None:
        if not reply.can_run:
            self._set(OTHER, mode, replaced, is_set=True)
        for name in self.masks:
            if name not in {OTHER, "offboard_signal"}:
                self._set(name, mode, replaced, is_set=name in reply.requirements)

    def _set(self, name: str, mode: int, replaced: int | None, *, is_set: bool) -> None:
        """Set the bit of a mode, and set or clear that of the mode that it replaces."""
        if is_set:
            self.masks[name] |= 1 << mode
        if replaced is not None:
            self.masks[name] = self.masks[name] & ~(1 << replaced) | is_set << replaced

    def missing(self, mode: int, senses: Senses, *, with_sticks: bool = True) -> tuple[str, ...]:
        """Return the requirements of a mode that are not met. Whether it prevents arming does not count.

        PX4's failsafes go `with_sticks` False: they deal with lost sticks by themselves.
        """
        ignored = {PREVENT_ARMING} if with_sticks else {PREVENT_ARMING, STICKS}
        needed = [name for name, mask in self.masks.items() if mask >> mode & 1 and name not in ignored]
        return tuple([name for name in needed if name == OTHER or not getattr(senses, name)])

    def prevents_arming(self, mode: int) -> bool:
        """Whether the vehicle must not be armed in a mode."""
        return bool(self.masks[PREVENT_ARMING] >> mode & 1)


_TEXTS: Mapping[str, str] = {
    **MEANINGS,
    "arming_check": "an arming check of a program says no, or has not answered yet",
    "battery": "the battery is empty",
    "has_fallen": "the vehicle has fallen over",
}
"""What is missing, for people."""


def texts_of(missing: Iterable[str]) -> str:
    """Return what is missing, for people."""
    return ", ".join(dict.fromkeys(_TEXTS[each] for each in missing))
