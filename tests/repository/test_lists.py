"""Tests that suffixes of recordings, schemes of links, modes, commands and setpoints stand in one table each."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest
import yaml

from msggen import flight
from msggen.base.recording_formats import FORMATS, PACKED
from msggen.definitions.identity import PX4_WRITER
from msggen.doctor.setpoint_rules import SETPOINT
from msggen.doctor.setpoints import SETPOINTS as STEERED
from msggen.link.link_types import LINK_TYPES
from msggen.messages import commands
from msggen.messages.nav_states import MODE_CONSTANTS, MODE_NAMES
from msggen.messages.setpoints import BY_NUMBER, KINDS, SELECTORS, SENT
from msggen.recordings.files.rosbag2.qos import QOS
from msggen.sim.airframes import AIRFRAMES
from msggen.sim.setpoints import Setpoints
from msggen.sim.world import World
from msggen.sources.embedded import EMBEDDED
from msggen.sources.read import read
from support.repository import ROOT

MODULES = {
    path.relative_to(ROOT / "msggen").as_posix(): path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "msggen").rglob("*.py"))
}
"""The text of each module, by its path, such as `link/link.py`."""
TABLES = ("base/recording_formats.py", "link/link_types.py")

SUFFIXES = [each.removeprefix(".") for each in (*PACKED, *(row.suffix for row in FORMATS.values()))]
NAMED = re.compile(rf"(?<!\.tar)[.|]({'|'.join(SUFFIXES)})\b", re.IGNORECASE)
"""A suffix, also one of several in a regular expression: `.(?:mcap|db3)`. Archives `.tar.gz` have no recordings."""

READ = {name for name, row in FORMATS.items() if not row.storage}
"""The formats that are only read: a module asks their row, or a channel, what they can do."""
QUOTED = re.compile(rf"""["']({"|".join((*LINK_TYPES, *FORMATS))})\b""")
STARTS = {"startswith", "endswith", "removeprefix"}


@cache
def nodes_of(source: str) -> tuple[ast.AST, ...]:
    """Return all nodes of the syntax tree of a module, those of outer statements first."""
    return (*ast.walk(ast.parse(source)),)


def texts(node: ast.AST | None) -> list[str]:
    """Return the text that a node is, or those of a tuple, a list, a set, or the keys of a dict."""
    if isinstance(node, (ast.Tuple, ast.List, ast.Set)):
        return [text for each in node.elts for text in texts(each)]
    if isinstance(node, ast.Dict):
        return [text for each in node.keys for text in texts(each)]
    return [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []


def compared(node: ast.AST) -> list[str]:
    """Return the texts that a node compares with something."""
    if isinstance(node, ast.Compare):
        return [text for each in (node.left, *node.comparators) for text in texts(each)]
    if isinstance(node, ast.MatchValue):
        return texts(node.value)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in STARTS:
        return [text for each in node.args for text in texts(each)]
    return []


def is_of_recording(text: str) -> bool:
    """Whether a text is a name or a pattern with a suffix of recordings, or a sentence that lists several of them.

    A sentence may have one: `the file flight.mcap`.
    """
    found = {each.lower() for each in NAMED.findall(text)}
    return bool(found) and (len(found) > 1 or not re.search(r"\s", text))


def second_lists(source: str) -> Iterator[str]:
    """Yield what a module has that belongs in a table. Docstrings may have all of it."""
    if not NAMED.search(source) and not QUOTED.search(source):
        return  # to look at all nodes takes long
    nodes = nodes_of(source)
    docs = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if id(node) in docs:
            continue
        if isinstance(node, ast.Constant):
            yield from filter(is_of_recording, texts(node))
        yield from (text for text in compared(node) if text.partition(":")[0] in LINK_TYPES or text in READ)
        for names in (LINK_TYPES, FORMATS):
            listed = [text for text in ([] if isinstance(node, ast.Constant) else texts(node)) if text in names]
            if len(listed) > 1:
                yield " ".join(listed)


def test_no_module_has_a_second_list() -> None:
    assert MODULES.keys() >= {*TABLES}
    found = {name: [*second_lists(source)] for name, source in MODULES.items()}
    assert {name: lists for name, lists in found.items() if lists and name not in TABLES} == {}


@pytest.mark.parametrize("table", TABLES)
def test_the_tables_would_be_found_elsewhere(table: str) -> None:
    assert [*second_lists(MODULES[table])]


def test_every_suffix_and_every_scheme_is_found() -> None:
    for suffix in SUFFIXES:
        assert [*second_lists(f'SUFFIX = ".{suffix}"')] == [f".{suffix}"]
    for scheme in LINK_TYPES:
        assert [*second_lists(f'is_meant = address.scheme == "{scheme}"')] == [scheme]


@pytest.mark.parametrize(
    "source",
    [
        'SUFFIXES = (".ulg",)',
        'path.endswith((".mcap", ".MCAP"))',
        'name = f"{stem}.cut.mcap"',
        'name = f"{stem}_{number:04}.mcap"',
        r'FILE = re.compile(r"(.*)_\d+\.(?:mcap|db3)")',
        'raise ValueError("expected a .ulg or .mcap file")',
        'KINDS = {"mcap": 1, "ulog": 2}',
        'is_whole = log.kind == "ulog"',
        'is_decoded = channel.encoding in ("cdr", "ulog")',
        'is_line = "serial" == scheme',
        'if seen.scheme in ("tap", "dds"):\n    pass',
        'if seen.scheme not in {"other", "udp"}:\n    pass',
        'is_dds = name.lower().startswith("dds")',
        'path = link.removeprefix("serial://")',
        'match scheme:\n    case "tap":\n        pass',
        'SCHEMES = ["udp", "serial"]',
        'OPENERS = {"udp": open_udp, "serial": open_serial}',
    ],
)
def test_a_second_list_is_found(source: str) -> None:
    assert [*second_lists(source)]


@pytest.mark.parametrize(
    "source",
    [
        '"""Read `.mcap` and `.ulg`."""',
        'SIZE = 1\n"""Of `flight.mcap`, `.db3`."""',
        'help = "file to write (default: merged.mcap)"',
        "from msggen.recordings.files.mcap.reader import McapFile",
        'is_listed = scheme in LINK_TYPES or kind == "mcap"',
        'scheme = "udp"',
        'link = f"udp://{place}"',
    ],
)
def test_one_name_in_a_sentence_and_an_address_are_no_list(source: str) -> None:
    assert not [*second_lists(source)]


# Modes and commands of PX4

OF_MODES = "messages/nav_states.py"
OF_COMMANDS = "messages/commands.py"
MODES = {text.lower() for names in (MODE_NAMES, MODE_CONSTANTS) for text in names.values()}
COMMANDS = {commands.SET_MODE, commands.SET_HOME, commands.REPOSITION, commands.ARM_DISARM, commands.SET_NAV_STATE}
"""The numbers of commands that are no everyday numbers."""


def lists_of_modes(source: str) -> list[list[str]]:
    """Return the lists with the names of four modes or more, which are a third of it."""
    if sum(mode in source.lower() for mode in MODES) < 4:  # to parse the whole house takes long
        return []
    listed = ([each.lower() for each in texts(node)] for node in nodes_of(source))
    dicts = (
        [text.lower() for value in node.values for text in texts(value)]
        for node in nodes_of(source)
        if isinstance(node, ast.Dict)
    )
    return [found for found in (*listed, *dicts) if len(MODES & {*found}) > max(3, len({*found}) / 3)]


def numbers_of_commands(source: str) -> set[int]:
    """Return the numbers of commands that a module names, if it has several."""
    if sum(str(number) in source.replace("_", "") for number in COMMANDS) < 2:
        return set()
    constants = [node.value for node in nodes_of(source) if isinstance(node, ast.Constant)]
    found = {each for each in constants if isinstance(each, int)} & COMMANDS
    return found if len(found) > 1 else set()


def test_no_module_has_a_second_list_of_modes_or_commands() -> None:
    assert {name for name, source in MODULES.items() if lists_of_modes(source)} == {OF_MODES}
    assert {name for name, source in MODULES.items() if numbers_of_commands(source)} == {OF_COMMANDS}


def test_a_second_list_of_modes_or_commands_is_found() -> None:
    assert lists_of_modes('_NAMES = {0: "Manual", 1: "Altitude", 2: "Position", 10: "Acro"}')
    assert lists_of_modes('_NAMES = {"MANUAL": "Manual", "ALTCTL": "x", "AUTO_LOITER": "x", "AUTO_RTL": "x"}')
    assert lists_of_modes('MODES = ("hold", "land", "return", "offboard")')
    assert not lists_of_modes('SHORT = ("arm", "disarm", "land", "takeoff", "mode")')
    assert numbers_of_commands("_ARM = 400\n_SET_MODE = (176, 100001)")
    assert not numbers_of_commands("_WIDTH = 400")


# Setpoints of PX4

OF_SETPOINTS = "messages/setpoints.py"
STEERING = ("link", "messages", "vehicle", "sim", "ros", "flight", "doctor")
"""The rooms that send or judge setpoints. Reports name what recordings have."""
SETPOINT_TOPICS = {topic for kind in KINDS for topic in kind.topics}


def topics_of_setpoints(source: str) -> set[str]:
    """Return the topics of setpoints that a module names, if it has several."""
    if sum(topic in source for topic in SETPOINT_TOPICS) < 2:
        return set()
    found = {text for node in nodes_of(source) if isinstance(node, ast.Constant) for text in texts(node)}
    named = found & SETPOINT_TOPICS
    return named if len(named) > 1 else set()


def test_no_module_has_a_second_list_of_setpoints() -> None:
    steering = {name: source for name, source in MODULES.items() if name.partition("/")[0] in STEERING}
    assert {name for name, source in steering.items() if topics_of_setpoints(source)} == {OF_SETPOINTS}


def test_a_second_list_of_setpoints_is_found() -> None:
    assert topics_of_setpoints('_TOPICS = ("goto_setpoint", "trajectory_setpoint")')
    assert topics_of_setpoints('if name == "goto_setpoint" or name == "vehicle_rates_setpoint":\n    pass')
    assert not topics_of_setpoints('help = "a topic, such as goto_setpoint or trajectory_setpoint"')


def test_setpoints_have_the_types_and_fields_of_the_newest_release() -> None:
    messages = {each.name: each for each in read(release=EMBEDDED[0]).messages.values()}
    numbers = {each.name: each.value for each in messages["SetpointConfig"].constants}
    types = {value for name, value in numbers.items() if name.startswith("TYPE_")} - {numbers["TYPE_INVALID"]}
    assert types == {*BY_NUMBER}
    fields = [each.name for each in messages["OffboardControlMode"].fields]
    assert fields == ["timestamp", *SELECTORS]
    flags = {each.name for each in messages["VehicleControlMode"].fields}
    older = {"acceleration", "auto"}  # up to v1.17
    controls = {name for kind in KINDS for name in kind.controls} - older
    assert {f"flag_control_{name}_enabled" for name in controls} <= flags
    topics = {topic for each in messages.values() for topic in each.topic_names}
    assert topics >= SETPOINT_TOPICS


def test_the_doctor_and_the_simulator_know_every_setpoint() -> None:
    assert {*STEERED} == {topic for kind in KINDS if kind.selectors for topic in kind.topics}
    fix = next(rule.fix for rule in SETPOINT if rule.id == "SETPOINT_UNSELECTED")
    selected = [topic for kind in KINDS if kind.selectors for topic in kind.topics]
    assert not [name for name in (*SELECTORS, *selected) if name not in fix]
    flown = {topic for each in AIRFRAMES.values() for topic in World(airframe=each).autopilot.handlers}
    assert Setpoints().handlers.keys() | flown >= {topic for kind in SENT for topic in kind.topics}


def test_flight_offers_every_kind_of_setpoint_that_its_modes_send() -> None:
    offered = {name: getattr(flight, name) for name in flight.__all__ if name.isupper()}
    kinds = {name: value if isinstance(value, tuple) else () for name, value in offered.items() if value not in SENT}
    assert {*SENT} <= {*offered.values(), *(kind for group in kinds.values() for kind in group)}
    names = {name for name, value in offered.items() if value in SENT} | {name for name, each in kinds.items() if each}
    pages = "".join(
        (ROOT / f"docs/{name}.md").read_text(encoding="utf-8") for name in ("flight_modes", "flight_vehicles")
    )
    assert not [name for name in names if f"\n| `{name}` | `" not in pages]


# Depths of queues

OF_DEPTHS = {"base/qos.py", "link/cyclone.py", "link/rmw_zenoh/names.py"}
"""That of programs, how many samples a reader in DDS keeps until msggen takes them, and those that tokens tell."""


def depths(source: str) -> list[int]:
    """Return the depths of queues that a module sets by itself. 1 is the least that ROS takes."""
    if "depth" not in source.lower():
        return []
    named: list[tuple[str | None, ast.AST | None]] = []
    for node in nodes_of(source):
        if isinstance(node, ast.keyword):
            named.append((node.arg, node.value))
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            named += [(each.id, node.value) for each in targets if isinstance(each, ast.Name)]
    found = [value for name, value in named if (name or "").lower().strip("_") == "depth"]
    numbers = [each.value for each in found if isinstance(each, ast.Constant)]
    return [each for each in numbers if isinstance(each, int) and each > 1]


def test_no_module_has_a_second_depth_of_queues() -> None:
    assert {name for name, source in MODULES.items() if depths(source)} == OF_DEPTHS


def test_a_second_depth_is_found() -> None:
    for source in ("_DEPTH = 10", "DEPTH: Final = 5", "profile = QoSProfile(depth=20)"):
        assert depths(source)
    assert not depths("DEPTH = 1.0\nprofile = QoSProfile(depth=max(qos.depth, 1))\ndepth = found.depth")


def test_recordings_have_the_quality_of_service_of_the_writers_of_px4() -> None:
    found = yaml.safe_load(QOS)[0]
    expected = (PX4_WRITER.reliability, PX4_WRITER.durability, PX4_WRITER.history)
    assert (found["reliability"], found["durability"], found["history"]) == (2, 1, 1)
    assert expected == ("BEST_EFFORT", "TRANSIENT_LOCAL", "KEEP_LAST")
    assert found["depth"] == max(PX4_WRITER.depth, 1)
