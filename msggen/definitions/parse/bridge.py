"""The parser of `dds_topics.yaml`: the topics that cross the bridge between uORB and DDS, or Zenoh.

PX4 may add to the file, so unknown keys and values are kept as data and reported as warnings. Errors are reported only
for entries that cannot be used. Keys have the meaning that the firmware's script gives them (docs/wire.md, 15 to 17).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeGuard

import yaml

from msggen.base.diagnostics import Diagnostic, InputError, suggestion
from msggen.base.location import Location
from msggen.definitions.model import BridgeEntry, Direction
from msggen.definitions.parse.yaml_nodes import describe, is_null, read_yaml, value_of

LISTS = {
    "publications": (Direction.OUT, False),
    "subscriptions": (Direction.IN, False),
    "subscriptions_multi": (Direction.IN, True),
}
"""The lists of the file, with the direction of their topics, and whether they route to instances."""

_NAMED = {"/fmu/out/": Direction.OUT, "/fmu/in/": Direction.IN}
"""The direction that the beginning of a topic's name says."""

_OF_PUBLICATIONS = ("rate_limit", "instance", "options")
_OF_MULTI = ("route_field", "max_instances")
_NOT_ON_ZENOH = ("rate_limit", *_OF_MULTI)
KEYS = ("topic", "type", *_OF_PUBLICATIONS, *_OF_MULTI)
"""The keys of an entry that msggen knows."""

_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_TYPE = re.compile(r"[a-z][a-z0-9_]*::msg::[A-Za-z][A-Za-z0-9_]*")
_FIELD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_MOST_INSTANCES = 255
"""Maximum number of instances of a topic. uORB counts them in 8 bits."""

_SLOWEST = 1000 / 2**32
"""The lowest rate limit in Hz other than 0. PX4 counts intervals in 32 bits of milliseconds."""

_UNLIMITED = ("unlimited", "off", "none")
"""Words for no rate limit, in upper or lower case."""

ZENOH_OPTIONS: Mapping[str, tuple[object, ...]] = MappingProxyType(
    {
        "cc": ("drop", "block"),
        "express": (True, False),
        "prio": (
            "real_time",
            "interactive_high",
            "interactive_low",
            "data_high",
            "data",
            "data_low",
            "background",
        ),
        "rel": ("reliable", "best_effort"),
    }
)
"""The options of a publication that the Zenoh client accepts, with their values (docs/wire.md, 17)."""


class Bridge(NamedTuple):
    """The entries of a YAML file, publications first. `extra` has the data of unknown top-level keys."""

    entries: tuple[BridgeEntry, ...] = ()
    extra: Mapping[str, object] = MappingProxyType({})
    found: tuple[Diagnostic, ...] = ()

    @property
    def has_new_keys(self) -> bool:
        """Whether the file has a key that is neither known nor similar to a known one."""
        unknown = {*self.extra, *(key for entry in self.entries for key in entry.extra)}.difference(KEYS)
        return any(not suggestion(key, (*KEYS, *LISTS)) for key in unknown)


def parse_bridge(data: bytes, path: str, *, is_zenoh: bool = False) -> Bridge:
    """Return the entries in `data`, the bytes of `path`, with the errors and warnings found.

    With `is_zenoh`, it is the list of Zenoh's client, which has no rates and no routes.
    """
    reader = _Reader(path, is_zenoh=is_zenoh)
    try:
        root = read_yaml(data, path)
    except InputError as error:
        return Bridge(found=error.diagnostics)
    bridge = reader.bridge(root) if root else Bridge()
    return bridge._replace(found=tuple(reader.found))


class _Reader:
    """A reader of YAML nodes that collects errors and warnings."""

    def __init__(self, path: str, *, is_zenoh: bool) -> None:
        self.path = path
        self.is_zenoh = is_zenoh
        self.found: list[Diagnostic] = []

    def bridge(self, root: yaml.Node) -> Bridge:
        lists, extra = self.mapping(root, tuple(LISTS), "the file")
        return Bridge(tuple(self.entries(lists)), MappingProxyType(extra))

    def entries(self, lists: Mapping[str, yaml.Node]) -> Iterator[BridgeEntry]:
        for name in LISTS:
            node = lists.get(name)
            if node is None or is_null(node):
                continue
            if not isinstance(node, yaml.SequenceNode):
                self.note(node, "Y102", f"'{name}': expected a list of topics, found {describe(node)}")
                continue
            for item in node.value:
                entry = self.entry(item, name)
                if entry:
                    yield entry

    def entry(self, node: yaml.Node, name: str) -> BridgeEntry | None:
        values, extra = self.mapping(node, KEYS, "an entry")
        for key in ("topic", "type"):
            if key not in values and isinstance(node, yaml.MappingNode):
                self.note(node, "Y104", f"expected the key '{key}'")
        topic = self.text(values.get("topic"), "topic", _TOPIC, "a name such as '/fmu/out/vehicle_status'")
        type_name = self.text(values.get("type"), "type", _TYPE, "a type such as 'px4_msgs::msg::VehicleStatus'")
        if not (topic and type_name):
            return None
        direction, multi = LISTS[name]
        self.check_direction(values["topic"], name)
        entry = BridgeEntry(
            direction=direction,
            topic=topic,
            type_name=type_name,
            location=self.place(values["topic"]),
            type_location=self.place(values["type"]),
            multi=multi,
        )
        optional = {
            key: node for key, node in values.items() if key in _OPTIONAL and (key == "instance" or not is_null(node))
        }
        if not (optional or extra):
            return entry
        without_effect = self.without_effect(optional, name)
        known = {key: node for key, node in optional.items() if key not in without_effect}
        return entry._replace(**self.optional(known, extra), extra=MappingProxyType(extra | without_effect))

    def check_direction(self, node: yaml.Node, name: str) -> None:
        """Warn about a topic whose name says that it belongs in a list of the other direction."""
        for start, direction in _NAMED.items():
            if node.value.startswith(start) and LISTS[name][0] is not direction:
                other = next(each for each, (found, _) in LISTS.items() if found is direction)
                self.note(node, "Y109", f"'{node.value}' in '{name}': topics '{start}...' belong in '{other}'")

    def without_effect(self, values: Mapping[str, yaml.Node], name: str) -> dict[str, object]:
        """Return the values of keys that have no effect in the list `name`, and warn about them."""
        keys = [*(_OF_PUBLICATIONS if name != "publications" else ())]
        keys += _OF_MULTI if name != "subscriptions_multi" else ()
        keys += _NOT_ON_ZENOH if self.is_zenoh else ()
        for key in dict.fromkeys(keys):
            if key in values and self.is_zenoh and key in _NOT_ON_ZENOH:
                self.note(values[key], "Y106", f"'{key}' has no effect in the list for Zenoh, only in that for DDS")
            elif key in values:
                other = "subscriptions_multi" if key in _OF_MULTI else "publications"
                self.note(values[key], "Y106", f"'{key}' has no effect in '{name}', only in '{other}'")
        return {key: value_of(values[key]) for key in keys if key in values}

    def optional(self, values: Mapping[str, yaml.Node], extra: dict[str, object]) -> dict[str, Any]:
        """Return the values of the optional keys. A value of an unknown kind goes to `extra`."""
        found: dict[str, Any] = {}
        for key, (read, expected) in _OPTIONAL.items():
            if key in values:
                value = read(value_of(values[key]))
                if value is None:
                    code = "Y107" if key == "options" else "Y108" if key in _OF_MULTI else "Y105"
                    self.note(values[key], code, f"'{key}': expected {expected}, found {describe(values[key])}")
                    extra[key] = value_of(values[key])
                else:
                    found["rate_limit_hz" if key == "rate_limit" else key] = value
        if "options" in found:
            self.check_options(values["options"])
        if "route_field" in values and "max_instances" not in values:
            self.note(values["route_field"], "Y104", "expected the key 'max_instances' beside 'route_field'")
        if "route_field" in found and "max_instances" not in found:
            extra["route_field"] = found.pop("route_field")
        return found

    def check_options(self, node: yaml.Node) -> None:
        """Warn about options that the Zenoh client rejects when it starts."""
        for key, value in node.value:
            name = str(describe(key))
            known = ZENOH_OPTIONS.get(name)
            if known is None:
                self.note(key, "Y107", f"unknown option '{name}'{suggestion(name, ZENOH_OPTIONS)}")
            elif repr(value_of(value)) not in map(repr, known):  # compared as text, because 1 == True in Python
                words = ", ".join(str(word).lower() for word in known)
                self.note(value, "Y107", f"'{name}': expected {words}; found {describe(value)}")

    def mapping(
        self, node: yaml.Node, known: Iterable[str], label: str
    ) -> tuple[dict[str, yaml.Node], dict[str, object]]:
        """Return the values of the `known` keys, and the data of the others. The last of two equal keys is used."""
        if not isinstance(node, yaml.MappingNode):
            self.note(node, "Y102", f"{label}: expected a mapping with {', '.join(known)}; found {describe(node)}")
            return {}, {}
        values: dict[str, yaml.Node] = {}
        extra: dict[str, object] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                self.note(key, "Y101", f"expected a string as a key, found {describe(key)}")
            elif key.value in known:
                if key.value in values:
                    self.note(key, "Y103", f"duplicate key '{key.value}', the last one is used")
                values[key.value] = value
            else:
                self.note(key, "Y103", f"unknown key '{describe(key)}'{suggestion(str(key.value), known)}")
                extra[str(describe(key))] = value_of(value)
        return values, extra

    def text(self, node: yaml.Node | None, key: str, pattern: re.Pattern[str], expected: str) -> str:
        if node is None:
            return ""
        if not isinstance(node, yaml.ScalarNode) or not pattern.fullmatch(node.value):
            self.note(node, "Y102", f"'{key}': expected {expected}, found {describe(node)}")
            return ""
        return str(node.value)

    def place(self, node: yaml.Node) -> Location:
        return Location(self.path, node.start_mark.line + 1, node.start_mark.column + 1)

    def note(self, node: yaml.Node, code: str, message: str) -> None:
        self.found.append(Diagnostic(self.place(node), code, message))


def read_rate(value: object) -> float | None:
    """Return a rate limit in Hz, 0.0 for no limit, None for a value that PX4's script rejects.

    YAML reads the word `off` as False, which is accepted as 0.
    """
    if isinstance(value, str):
        return 0.0 if value.strip().lower() in _UNLIMITED else None
    try:
        rate = float(value) if isinstance(value, (int, float)) else math.nan
    except OverflowError:
        return None
    return None if math.isnan(rate) or 0 < rate < _SLOWEST else max(rate, 0.0)


def _instance(value: object) -> int | None:
    return value if _is_whole(value) and value >= 0 else None


def _count(value: object) -> int | None:
    return value if _is_whole(value) and 1 <= value <= _MOST_INSTANCES else None


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)


def _field(value: object) -> str | None:
    return value if isinstance(value, str) and _FIELD.fullmatch(value) else None


def _mapping(value: object) -> Mapping[str, object] | None:
    return MappingProxyType(value) if isinstance(value, dict) else None


_OPTIONAL: Mapping[str, tuple[Callable[[object], object], str]] = MappingProxyType(
    {
        "rate_limit": (read_rate, "a frequency in Hz, 0 or 'unlimited'"),
        "instance": (_instance, "an integer of at least 0"),
        "route_field": (_field, "the name of a field"),
        "max_instances": (_count, f"an integer from 1 to {_MOST_INSTANCES}"),
        "options": (_mapping, "a mapping"),
    }
)
"""The function that reads each optional key, and a description of the values that it accepts."""
