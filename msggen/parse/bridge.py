"""`dds_topics.yaml`: what crosses the bridge between uORB and DDS (FACTS 4)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml

from msggen.diagnostics import Diagnostic, suggestion
from msggen.location import Location
from msggen.model import BridgeEntry, Direction

_LISTS = {
    "publications": (Direction.OUT, False),
    "subscriptions": (Direction.IN, False),
    "subscriptions_multi": (Direction.IN, True),
}
_KEYS = ("topic", "type", "rate_limit", "instance", "options")
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_TYPE = re.compile(r"[a-z][a-z0-9_]*::msg::[A-Z][A-Za-z0-9]*")
_MAX_DEPTH = 32
_MAX_INSTANCE = 255
"""uORB counts instances in 8 bits."""

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def parse_bridge(data: bytes, path: str) -> tuple[tuple[BridgeEntry, ...], list[Diagnostic]]:
    """Read the bytes of `path`; return its entries, publications first, with all that is wrong with it."""
    reader = _Reader(path)
    try:
        text = data.decode("utf-8-sig")
        _check_depth(text)
        root = yaml.compose(text, Loader=_LOADER)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
        what = " ".join(str(part) for part in (error.context, error.problem) if part)
        return (), [Diagnostic(Location(path, line, column), "Y101", f"not YAML: {what}")]
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        return (), [Diagnostic(Location(path, line, column), "Y101", f"byte 0x{data[error.start]:02x} is not UTF-8")]
    except yaml.YAMLError as error:
        return (), [Diagnostic(Location(path), "Y101", f"not YAML: {str(error).splitlines()[0]}")]
    return (tuple(reader.entries(root)) if root else ()), reader.faults


def _check_depth(text: str) -> None:
    """Raise YAMLError for nesting that no bridge has, and that PyYAML's C code would end the process over."""
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        mark: Any = event.start_mark
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem=f"nested deeper than {_MAX_DEPTH}", problem_mark=mark)


class _Reader:
    """Reads YAML nodes, and notes what is wrong with them."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.faults: list[Diagnostic] = []

    def entries(self, root: yaml.Node) -> Iterator[BridgeEntry]:
        lists = self.mapping(root, tuple(_LISTS), "the file")
        for name, (direction, multi) in _LISTS.items():
            node = lists.get(name)
            if node is None or _is_null(node):
                continue
            if not isinstance(node, yaml.SequenceNode):
                self.fault(node, "Y102", f"'{name}': expected a list of topics, found {_found(node)}")
                continue
            for item in node.value:
                entry = self.entry(item, direction, multi=multi)
                if entry:
                    yield entry

    def entry(self, node: yaml.Node, direction: Direction, *, multi: bool) -> BridgeEntry | None:
        values = self.mapping(node, _KEYS, "an entry")
        for key in ("topic", "type"):
            if key not in values and isinstance(node, yaml.MappingNode):
                self.fault(node, "Y104", f"expected the key '{key}'")
        topic = self.text(values.get("topic"), "topic", _TOPIC, "a name such as '/fmu/out/vehicle_status'")
        type_name = self.text(values.get("type"), "type", _TYPE, "a type such as 'px4_msgs::msg::VehicleStatus'")
        rate_limit = self.number(values.get("rate_limit"), "rate_limit", float, 1e9, "a frequency in Hz or 'unlimited'")
        instance = self.number(
            values.get("instance"), "instance", int, _MAX_INSTANCE, f"a whole number from 0 to {_MAX_INSTANCE}"
        )
        options = values.get("options")
        if options and not isinstance(options, yaml.MappingNode) and not _is_null(options):
            self.fault(options, "Y102", f"'options': expected a mapping, found {_found(options)}")
        if not (topic and type_name):
            return None
        return BridgeEntry(
            direction,
            topic,
            type_name,
            self.place(values["topic"]),
            self.place(values["type"]),
            multi,
            None if rate_limit is None else float(rate_limit),
            None if instance is None else int(instance),
        )

    def mapping(self, node: yaml.Node, known: tuple[str, ...], what: str) -> dict[str, yaml.Node]:
        if not isinstance(node, yaml.MappingNode):
            self.fault(node, "Y102", f"{what}: expected a mapping with {', '.join(known)}; found {_found(node)}")
            return {}
        values: dict[str, yaml.Node] = {}
        for key, value in node.value:
            if key.value not in known:
                self.fault(key, "Y103", f"unknown key '{_found(key)}'{suggestion(str(key.value), known)}")
            elif key.value in values:
                self.fault(key, "Y103", f"the key '{key.value}' stands here twice")
            else:
                values[key.value] = value
        return values

    def text(self, node: yaml.Node | None, key: str, pattern: re.Pattern[str], expected: str) -> str:
        if node is None:
            return ""
        if not isinstance(node, yaml.ScalarNode) or not pattern.fullmatch(node.value):
            self.fault(node, "Y102", f"'{key}': expected {expected}, found {_found(node)}")
            return ""
        return str(node.value)

    def number(self, node: yaml.Node | None, key: str, kind: type[float], most: float, expected: str) -> float | None:
        if node is None:
            return None
        if key == "rate_limit" and node.value == "unlimited":
            return 0.0
        value = _number(node) if kind is float or node.tag.endswith(":int") else -1
        if not 0 <= value <= most:
            self.fault(node, "Y102", f"'{key}': expected {expected}, found {_found(node)}")
        return value

    def place(self, node: yaml.Node) -> Location:
        return Location(self.path, node.start_mark.line + 1, node.start_mark.column + 1)

    def fault(self, node: yaml.Node, code: str, message: str) -> None:
        self.faults.append(Diagnostic(self.place(node), code, message))


def _number(node: yaml.Node) -> float:
    """Return the number that YAML takes the node for, or -1."""
    if not isinstance(node, yaml.ScalarNode) or not node.tag.endswith((":int", ":float")):
        return -1
    try:
        value: float = yaml.constructor.SafeConstructor().construct_object(node)
    except ValueError:
        return -1
    return value


def _is_null(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.tag.endswith(":null")


def _found(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return (node.value if node.value.isprintable() else repr(node.value)) or "nothing"
    return "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"
