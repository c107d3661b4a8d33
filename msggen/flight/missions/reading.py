"""Mission files as plans: JSON of version 1, as px4-ros2-interface-lib reads it. All errors are found in one run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from msggen.base.checked import shortened
from msggen.base.diagnostics import Diagnostic, InputError, input_error, sorted_out, suggestion
from msggen.base.disk.reading import read_text
from msggen.base.location import Places
from msggen.flight.missions.located import BrokenError, Value, read
from msggen.flight.missions.plan import (
    CHANGE,
    HOOKS,
    NAVIGATION,
    RESERVED,
    RESET,
    SETTINGS,
    VERSION,
    ActionItem,
    Item,
    Plan,
    Settings,
    Waypoint,
)
from msggen.flight.places import GlobalPlace
from msggen.messages.ranges import AIRSPEED, HEIGHT_RATE, SPEED, TURN_RATE, Bound

_LARGEST = 3.4e38
"""What a float32 holds."""


class Expected(NamedTuple):
    """What a value has to be, for people, and whether one is that."""

    text: str
    holds: Callable[[Any], bool]


def _number(least: float, most: float) -> Callable[[Any], bool]:
    return lambda value: type(value) in {int, float} and least <= value <= most


NUMBER: Final = Expected("a number", _number(-_LARGEST, _LARGEST))
NOT_NEGATIVE: Final = Expected("a number of at least 0", _number(0.0, _LARGEST))
LATITUDE: Final = Expected("a latitude from -90 to 90", _number(-90.0, 90.0))
LONGITUDE: Final = Expected("a longitude from -180 to 180", _number(-180.0, 180.0))
TRUTH: Final = Expected("true or false", lambda value: isinstance(value, bool))
TEXT: Final = Expected("a text", lambda value: isinstance(value, str))
OBJECT: Final = Expected("an object", lambda value: isinstance(value, dict))
ARRAY: Final = Expected("an array", lambda value: isinstance(value, list))


def _limit(unit: str, *bounds: Bound, is_above_0: bool = True) -> Expected:
    """Return what a limit of the flight has to be: no more than any vehicle has by the parameters of PX4."""
    most = max(each.extreme for each in bounds)
    is_within = _number(0.0, most)
    if not is_above_0:
        return Expected(f"a number from 0 to {most:g} {unit}", is_within)
    return Expected(f"a number above 0, and {most:g} {unit} at most", lambda value: is_within(value) and value > 0.0)


_LIMITS = (
    _limit("m/s", AIRSPEED.most, SPEED.most),
    _limit("m/s", HEIGHT_RATE.least, HEIGHT_RATE.most),
    _limit("degrees/s", TURN_RATE.most, is_above_0=False),
)
LIMITS: Final[Mapping[str, Expected]] = MappingProxyType(dict(zip(SETTINGS, _LIMITS, strict=True)))
"""The limits of a flight. At a speed of 0, PX4 does not move, and would never arrive; without turning, it does."""
ARGUMENTS: Final[Mapping[str, Mapping[str, Expected]]] = MappingProxyType(
    {
        "takeoff": {"altitude": NUMBER},
        "land": {},
        "rtl": {},
        "hold": {"duration": NOT_NEGATIVE},
        CHANGE: {**LIMITS, RESET: TRUTH},
    }
)
"""The actions that every mission has, and the arguments that each takes."""


_BROKEN, _WRONG, _UNKNOWN_ACTION, _UNSUPPORTED, _UNKNOWN_KEY, _SAME_ID = "F101", "F102", "F103", "F104", "F105", "F106"
_WAYPOINT: Mapping[str, Expected] = {"x": LATITUDE, "y": LONGITUDE, "z": NUMBER}
_ONLY: Mapping[str, str] = {"navigationType": "waypoint", "frame": "global"}
"""The keys of waypoints that have one value."""
_NONE: Mapping[str, object] = MappingProxyType({})


class Read(NamedTuple):
    """A plan, and the warnings about its file."""

    plan: Plan
    warnings: tuple[Diagnostic, ...]


def read_mission(path: str, actions: Mapping[str, object] = _NONE) -> Read:
    """Read a mission file. `actions` are those of the program by their names; None removes one that is built in.

    Raises InputError, also for a file that cannot be read.
    """
    try:
        text = read_text(path)
    except OSError as error:
        raise input_error(path, _BROKEN, f"cannot be read: {error.strerror}", 0) from None
    except UnicodeDecodeError as error:
        raise input_error(path, _BROKEN, f"byte {error.object[error.start]:#04x} is not UTF-8", 0) from None
    return parse_mission(text, path, actions)


def parse_mission(text: str, path: str, actions: Mapping[str, object] = _NONE) -> Read:
    """Return the plan of the text of a mission file, as `read_mission`. Raises InputError."""
    places = Places(text, path)
    try:
        document = read(text)
    except BrokenError as error:
        raise InputError([Diagnostic(places.at(error.position), _BROKEN, str(error))]) from None
    return _Reading(places, actions).read(document)


class _Reading:
    """Reads a document, and collects what is wrong with it."""

    def __init__(self, places: Places, actions: Mapping[str, object]) -> None:
        self._places, self._own = places, actions
        removed = {name for name, action in actions.items() if action is None}
        self._known = {*ARGUMENTS, *actions}.difference(removed, HOOKS)
        self._found: list[Diagnostic] = []

    def read(self, document: Value) -> Read:
        top = self._object(document, "the file", ("version", "mission"))
        version, mission = top.get("version"), top.get("mission")
        if version is not None and (type(version.content) is not int or version.content != VERSION):
            found = shortened(version.plain)
            self._tell(version.start, _UNSUPPORTED, f"unsupported version {found}: msggen reads version {VERSION}")
        plan = Plan(()) if mission is None else self._plan(mission)
        return Read(plan, sorted_out(self._found))

    def _plan(self, mission: Value) -> Plan:
        inside = self._object(mission, "the mission", ("items",), ("defaults",))
        defaults, items = inside.get("defaults"), inside.get("items")
        settings = {} if defaults is None else self._values(defaults, "'defaults'", {}, LIMITS)
        content: list[Value] = []
        if items is not None and self._is(items, ARRAY) and isinstance(items.content, list):
            content = items.content
            if not content:
                self._tell(items.start, _WRONG, "the mission has no items")
        found = [item for each in content if (item := self._item(each)) is not None]
        self._check_ids(content)
        return Plan(tuple(found), Settings().merged(settings))

    def _item(self, value: Value) -> Item | None:
        if not self._is(value, OBJECT):
            return None
        members = _members(value)
        kind, name = members.get("type"), members.get("id")
        is_named = name is None or self._is(name, TEXT, "id")
        if kind is None:
            self._tell(value.start, _WRONG, "the item has no 'type'")
            return None
        if not self._is(kind, TEXT, "type") or not is_named:
            return None
        text = "" if name is None else str(name.content)
        if kind.content == NAVIGATION:
            return self._waypoint(value, text)
        return self._action(value, kind, text)

    def _waypoint(self, value: Value, name: str) -> Waypoint | None:
        optional = {"type": TEXT, "id": TEXT}
        only = {key: Expected(f"'{text}'", TEXT.holds) for key, text in _ONLY.items()}
        found = self._values(value, "the waypoint", {**only, **_WAYPOINT}, optional)
        for key in [key for key, text in _ONLY.items() if found.get(key, text) != text]:
            text = f"{key} '{found.pop(key)}' is not supported: version {VERSION} of the format has only '{_ONLY[key]}'"
            self._tell(_members(value)[key].start, _UNSUPPORTED, text)
        if not found.keys() >= {*_ONLY, *_WAYPOINT}:
            return None
        place = GlobalPlace(*(float(found[key]) for key in _WAYPOINT))
        return Waypoint(place, name)

    def _action(self, value: Value, kind: Value, item_id: str) -> ActionItem:
        name = str(kind.content)
        if name in HOOKS:
            self._tell(kind.start, _UNKNOWN_ACTION, f"'{name}' is no item: the mission itself calls it")
        elif name.startswith(RESERVED):
            self._tell_reserved(kind.start, name)
        elif name not in self._known:
            near = suggestion(name, [*self._known, NAVIGATION]) or f": there are {', '.join(sorted(self._known))}."
            text = f"unknown action '{name}'{near} Name those of your program in `actions`, or with --action"
            self._tell(kind.start, _UNKNOWN_ACTION, text)
        if name in ARGUMENTS and name not in self._own:
            given = self._values(value, f"'{name}'", {}, {**ARGUMENTS[name], "type": TEXT, "id": TEXT})
            if name == CHANGE:
                self._check_change(value, given)
        else:
            self._check_reserved(_members(value))
        arguments = {key: each.plain for key, each in _members(value).items() if key not in {"type", "id"}}
        return ActionItem(name, arguments, item_id)

    def _check_change(self, value: Value, given: Mapping[str, Any]) -> None:
        """Warn of a `changeSettings` of which nothing, or not all, has an effect."""
        changed = [key for key in _members(value) if key in SETTINGS]
        if given.get(RESET):
            for key in changed:
                self._tell(_members(value)[key].name, _UNKNOWN_KEY, f"'{key}' has no effect beside '{RESET}': true")
        elif not changed:
            self._tell(
                value.start, _UNKNOWN_KEY, f"'{CHANGE}' changes nothing: give it {', '.join(SETTINGS)} or {RESET}"
            )

    def _check_reserved(self, members: Mapping[str, Value]) -> None:
        for key in members:
            if key.startswith(RESERVED):
                self._tell_reserved(members[key].name, key)

    def _tell_reserved(self, position: int, name: str) -> None:
        self._tell(position, _WRONG, f"'{name}': names with '{RESERVED}' are reserved")

    def _check_ids(self, items: Iterable[Value]) -> None:
        """Warn of ids that several items have. PX4's library does not look at them, but people do."""
        first: dict[str, Value] = {}
        for value in (_members(each).get("id") for each in items):
            if value is None or not isinstance(value.content, str):
                continue
            before = first.setdefault(value.content, value)
            if before is not value:
                line = self._places.at(before.start).line
                self._tell(value.start, _SAME_ID, f"id '{value.content}' is that of the item on line {line}, too")

    # members of objects

    def _values(
        self, value: Value, what: str, required: Mapping[str, Expected], optional: Mapping[str, Expected]
    ) -> dict[str, Any]:
        """Return the values of an object that are as expected, without positions. Tell of the others."""
        known = {**required, **optional}
        members = self._object(value, what, (*required,), (*optional,))
        return {key: each.plain for key, each in members.items() if key in known and self._is(each, known[key], key)}

    def _object(
        self, value: Value, what: str, required: tuple[str, ...], optional: tuple[str, ...] = ()
    ) -> Mapping[str, Value]:
        if not self._is(value, OBJECT):
            return {}
        members = _members(value)
        for key in required:
            if key not in members:
                self._tell(value.start, _WRONG, f"{what} has no '{key}'")
        known = (*required, *optional)
        self._check_reserved(members)
        for key, each in members.items():
            if key not in known and not key.startswith(RESERVED):
                near = suggestion(key, known) or f": it has {', '.join(known)}"
                self._tell(each.name, _UNKNOWN_KEY, f"unknown key '{key}' of {what}{near}")
        return members

    def _is(self, value: Value, expected: Expected, key: str = "") -> bool:
        if expected.holds(value.content):
            return True
        front = f"'{key}': " if key else ""
        self._tell(value.start, _WRONG, f"{front}expected {expected.text}, got {shortened(value.plain)}")
        return False

    def _tell(self, position: int, code: str, text: str) -> None:
        self._found.append(Diagnostic(self._places.at(position), code, text))


def _members(value: Value) -> Mapping[str, Value]:
    return value.content if isinstance(value.content, dict) else {}
