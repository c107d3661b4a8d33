"""Fields that are parts of one vector or one rotation: x, y and z, or roll, pitch and yaw."""

from __future__ import annotations

from collections.abc import Sequence

from msggen.definitions.model import Field, Message

AXES_OF_VECTORS = (("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az"))
AXES = (
    *AXES_OF_VECTORS,
    ("north", "east", "down"),
    ("n", "e", "d"),
    ("roll", "pitch", "yaw"),
    ("rollspeed", "pitchspeed", "yawspeed"),
)
"""Words of names of which one stands in the place of another: `vx`, `vy`, `vz`; `delta_x`, `delta_y`."""


def joined(message: Message, axes: Sequence[Sequence[str]] = AXES) -> list[list[Field]]:
    """Return the groups of at least two fields of one type whose names differ only in a word of `axes`."""
    groups: dict[tuple[str, ...], list[Field]] = {}
    for field in message.fields:
        words = field.name.split("_")
        for number, group in enumerate(axes):
            places = [index for index, word in enumerate(words) if word in group]
            if len(places) == 1:
                rest = (*words[: places[0]], f"{number} ", *words[places[0] + 1 :], str(field.type))
                groups.setdefault(rest, []).append(field)
    return [fields for fields in groups.values() if len(fields) > 1]
