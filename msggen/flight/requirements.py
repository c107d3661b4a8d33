"""Requirements of modes. PX4 enters a mode only if they are met, and leaves it when one of them is lost."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Flag, auto
from functools import reduce
from operator import or_


class Requirement(Flag):
    """Requirements of a mode, to be combined with `|`: `mode_req_...` of ArmingCheckReply."""

    NONE = 0
    ANGULAR_VELOCITY = auto()
    ATTITUDE = auto()
    LOCAL_ALT = auto()
    LOCAL_POSITION = auto()
    LOCAL_POSITION_RELAXED = auto()
    """A local position of low accuracy is enough."""
    GLOBAL_POSITION = auto()
    MISSION = auto()
    HOME_POSITION = auto()
    MANUAL_CONTROL = auto()
    """Stick input of a pilot."""
    PREVENT_ARMING = auto()
    """The vehicle is not armed in this mode."""

    @property
    def fields(self) -> frozenset[str]:
        """The names of the fields of ArmingCheckReply that are set."""
        return frozenset(f"mode_req_{each.name.lower()}" for each in Requirement if each in self and each.name)


ATTITUDE = Requirement.ANGULAR_VELOCITY | Requirement.ATTITUDE
"""What attitude setpoints need."""
LOCAL_POSITION = ATTITUDE | Requirement.LOCAL_ALT | Requirement.LOCAL_POSITION
"""What goto and trajectory setpoints need."""
GLOBAL_POSITION = LOCAL_POSITION | Requirement.GLOBAL_POSITION
"""What goto setpoints by latitude and longitude need."""


def named(names: Iterable[str]) -> Requirement:
    """Return the requirements with names such as `local_position`."""
    return reduce(or_, (Requirement[name.upper()] for name in names), Requirement.NONE)
