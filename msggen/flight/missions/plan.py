"""What a mission file says: waypoints and actions one after the other, and the limits that they begin with."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

from msggen.flight.places import GlobalPlace
from msggen.messages import earth

VERSION: Final = 1
NAVIGATION: Final = "navigation"
"""The `type` of waypoints. All other types are names of actions."""
RESERVED: Final = "internal:"
"""How names begin that files do not use."""
RESUMING: Final = "internal:resuming"
"""The argument of an action that runs again because the mission was interrupted in it."""


CHANGE, RESET = "changeSettings", "resetAll"
"""The action that changes settings, and its argument that undoes the changes."""
ON_RESUME, ON_FAILURE = HOOKS = ("onResume", "onFailure")
"""The actions that are no items: the mission itself calls them."""


class Settings(NamedTuple):
    """Limits of a flight. None: PX4's own."""

    horizontal_velocity: float | None = None
    """In m/s."""
    vertical_velocity: float | None = None
    """In m/s."""
    max_heading_rate: float | None = None
    """In degrees/s. 0: the vehicle does not turn."""

    def merged(self, arguments: Mapping[str, Any]) -> Settings:
        """Return these settings, with those of `changeSettings`."""
        return self._replace(**{field: arguments[key] for key, field in SETTINGS.items() if key in arguments})

    @property
    def arguments(self) -> dict[str, float]:
        """The settings by their names in files, without those that are PX4's own."""
        values = {key: getattr(self, field) for key, field in SETTINGS.items()}
        return {key: value for key, value in values.items() if value is not None}


HEADING_RATE: Final = "maxHeadingRate"
SETTINGS: Mapping[str, str] = MappingProxyType(
    {
        "horizontalVelocity": "horizontal_velocity",
        "verticalVelocity": "vertical_velocity",
        HEADING_RATE: "max_heading_rate",
    }
)
"""The fields of Settings by their names in files."""


@dataclass(frozen=True)
class Waypoint:
    """A place to fly to."""

    place: GlobalPlace
    id: str = ""

    @property
    def document(self) -> dict[str, Any]:
        """The item as in a file."""
        place = {"x": self.place.latitude, "y": self.place.longitude, "z": self.place.altitude}
        return {"type": NAVIGATION, "navigationType": "waypoint", "frame": "global", **place, **_named(self.id)}


@dataclass(frozen=True)
class ActionItem:
    """An action to run."""

    name: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """All keys of the item but `type` and `id`."""
    id: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "arguments", MappingProxyType(dict(self.arguments)))

    @property
    def document(self) -> dict[str, Any]:
        """The item as in a file. Actions get this as their arguments."""
        return {**self.arguments, "type": self.name, **_named(self.id)}


Item: TypeAlias = "Waypoint | ActionItem"


class Plan(NamedTuple):
    """The items of a mission, and the settings that it begins with."""

    items: Sequence[Item]
    defaults: Settings = Settings()

    def dump(self) -> str:
        """Return the text of a mission file, as px4-ros2-interface-lib writes it."""
        return json.dumps(self._document, indent=4, sort_keys=True, allow_nan=False)

    @property
    def checksum(self) -> str:
        """A number that differs for other missions."""
        text = json.dumps(self._document, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return blake2b(text.encode(), digest_size=16).hexdigest()

    @property
    def _document(self) -> dict[str, Any]:
        items = [each.document for each in self.items]
        return {"version": VERSION, "mission": {"defaults": self.defaults.arguments, "items": items}}

    @property
    def waypoints(self) -> Sequence[Waypoint]:
        """The waypoints among the items."""
        return [each for each in self.items if isinstance(each, Waypoint)]

    @property
    def length(self) -> float:
        """The length in m of straight lines from waypoint to waypoint."""
        places = [each.place for each in self.waypoints]
        return sum(map(_distance, places, places[1:]))

    def last_action(self, name: str, before: int) -> ActionItem | None:
        """Return the last action of a name before an index."""
        found = [each for each in self.items[:before] if isinstance(each, ActionItem) and each.name == name]
        return found[-1] if found else None

    def last_waypoint(self, before: int) -> Waypoint | None:
        """Return the last waypoint before an index."""
        found = [each for each in self.items[:before] if isinstance(each, Waypoint)]
        return found[-1] if found else None

    def segment(self, start: int) -> tuple[Sequence[Waypoint], Sequence[ActionItem]]:
        """Return the waypoints from an index up to the next action, and the actions that follow them directly."""
        end = start
        waypoints: list[Waypoint] = []
        while end < len(self.items) and isinstance(waypoint := self.items[end], Waypoint):
            waypoints.append(waypoint)
            end += 1
        actions: list[ActionItem] = []
        while end < len(self.items) and isinstance(action := self.items[end], ActionItem):
            actions.append(action)
            end += 1
        return waypoints, actions


def _distance(one: GlobalPlace, other: GlobalPlace) -> float:
    north, east = earth.local((one.latitude, one.longitude), other.latitude, other.longitude)
    return math.hypot(north, east, other.altitude - one.altitude)


def _named(name: str) -> dict[str, str]:
    return {"id": name} if name else {}
