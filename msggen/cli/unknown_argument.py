"""What to do about an argument that a command does not have. It is imported only for such an argument.

The tables tell what msggen has instead of words of other programs: ROS 2, MAVSDK, pyulog, MicroXRCEAgent and PX4's
shell.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from msggen.base.diagnostics import suggestion
from msggen.base.disk.git import is_revision
from msggen.sources.embedded import names_release
from msggen.sources.installed import names_installed
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import is_firmware

ACTIONS: Mapping[str, str] = {
    **dict.fromkeys(
        ("info", "show", "findings", "plot", "report", "compare", "convert", "compact", "cut", "merge", "repair"), "log"
    ),
    **dict.fromkeys(("echo", "hz", "bw", "delay", "list", "pub", "type", "find"), "topic"),
}
"""The commands of actions that users type without them."""

SYNONYMS: Mapping[str, str] = {"show": "info"}
"""What an action is called otherwise in ROS 2, for suggestions."""

_NO_AGENT = "no agent is needed: PX4's client connects to msggen; `msggen doctor --link udp://0.0.0.0:8888` shows it"
_PARAMETERS = "parameters are set with QGroundControl or MAVSDK; `msggen log show FILE --params` prints those of a ULog"
_MODES = "`msggen command mode NAME` selects a mode, such as hold, and `msggen topic echo vehicle_status` shows it"
_MISSIONS = (
    "PX4's own missions and fences go over MAVLink, with QGroundControl or MAVSDK; `msggen mission check` checks "
    "mission files, which programs fly (docs/missions.md)"
)

_NO_QOS = "leave it out: there is no QoS between msggen and PX4, and every sample that arrives is taken"
_QOS = tuple(f"--qos-{name}" for name in ("profile", "depth", "history", "reliability", "durability", "liveliness"))

COMMANDS: Mapping[str, str] = {
    # ROS 2
    "param": _PARAMETERS,
    "node": "PX4 has no nodes: `msggen topic list` lists the topics, `msggen link list` the programs on a link",
    "service": "`msggen call` calls a service of the vehicle",
    "action": "PX4 has no actions: `msggen command` sends a command",
    "bag": "`msggen record`, `msggen play` and `msggen log info` do what ros2 bag does",
    "interface": "`msggen topic info TOPIC` shows the fields of a message, and `msggen docs` writes pages about all",
    "msg": "`msggen topic info TOPIC` shows the fields of a message, and `msggen docs` writes pages about all",
    "pkg": "`msggen sync` writes the package px4_msgs",
    "run": "`msggen relay` carries the topics to ROS 2; programs use msggen.live (docs/vehicle.md)",
    "launch": "`msggen relay` carries the topics to ROS 2; programs use msggen.live (docs/vehicle.md)",
    "daemon": "`msggen link list` lists the processes that own a link, `msggen link stop` stops one",
    "wtf": "`msggen doctor` finds out why nothing arrives",
    "replay": "`msggen play FILE` plays a recording",
    "rosbag": "`msggen record`, `msggen play` and `msggen log info` do what ros2 bag does",
    "sub": "`msggen topic echo TOPIC` prints the messages of a topic",
    # MAVSDK
    "connect": "a vehicle connects by itself: `msggen topic list` waits for it, and `msggen doctor` finds out why not",
    "telemetry": "`msggen top` shows all topics, and `msggen topic echo TOPIC` one",
    "subscribe": "`msggen topic echo TOPIC` prints the messages of a topic",
    "publish": "`msggen topic pub TOPIC VALUES` publishes",
    "arm": "`msggen command arm`",
    "disarm": "`msggen command disarm`",
    "takeoff": "`msggen command takeoff METRES`",
    "land": "`msggen command land`",
    "rtl": "`msggen command rtl`",
    "return_to_launch": "`msggen command rtl`",
    "hold": "`msggen command mode hold`",
    "goto": "`msggen command DO_REPOSITION`, or `flight.goto` in a program (docs/flight.md)",
    "offboard": "`flight.offboard()` in a program (docs/flight.md), or `msggen topic pub`",
    "mode": _MODES,
    "modes": _MODES,
    "missions": _MISSIONS,
    "geofence": _MISSIONS,
    "params": _PARAMETERS,
    # pyulog
    "ulog_info": "`msggen log info FILE`",
    "ulog_messages": "`msggen log show FILE --texts`",
    "ulog_params": "`msggen log show FILE --params`",
    "ulog2csv": "`msggen log convert FILE --format csv`",
    "ulog2rosbag": "`msggen log convert FILE --format rosbag2`",
    "ulog_migratedb": "`msggen log info FILE...` reads many logs",
    "ulog2kml": "`msggen log show FILE vehicle_gps_position` prints the positions; msggen writes no KML",
    "ulog_extract_gps_dump": "`msggen log convert FILE` writes the samples of all topics; there are no dumps of GPS",
    # MicroXRCEAgent
    "microxrceagent": _NO_AGENT,
    "agent": _NO_AGENT,
    "udp4": _NO_AGENT,
    "udp6": _NO_AGENT,
    "serial": "no agent is needed: `msggen topic list --link serial:///dev/ttyUSB0?baud=921600`",
    # PX4's shell, and others
    "listener": "`msggen topic echo TOPIC` prints what PX4's `listener` prints",
    "uorb": "`msggen top` shows the topics that cross the bridge, as `uorb top`",
    "shell": "PX4's shell goes over MAVLink, as in QGroundControl; `msggen completion` is for yours",
    "help": "`msggen --help` lists the commands, and `msggen COMMAND --help` the arguments of one",
    "version": "`msggen --version`",
    "generate": "`msggen build` generates a package",
    "diff": "`msggen breaking --against REF` compares definitions",
}
"""What to do about a word in place of a command or an action, in lower case."""

ARGUMENTS: Mapping[tuple[str, str], str] = {
    **{(f"topic {action}", option): _NO_QOS for action in ("echo", "hz", "bw", "delay", "pub") for option in _QOS},
    **dict.fromkeys(
        (("topic info", "-v"), ("topic info", "--verbose")), "the publishers and the QoS are shown without it"
    ),
    ("topic echo", "--timeout"): "use --for",
    ("topic hz", "-w"): "use --window, in seconds",
    ("topic plot", "-f"): "use --field",
    ("topic echo", "-f"): "use --field for a single value; messages are printed whole",
    ("topic echo", "--no-arr"): "use --field for a single value",
    ("topic echo", "--full-length"): "messages are printed whole without it",
    ("record", "-a"): "all topics are recorded without it",
    ("record", "--all"): "all topics are recorded without it",
    ("play", "--speed"): "use --rate",
    ("play", "--link"): "use --to",
    ("play", "--port"): "name it with --to udp://127.0.0.1:PORT",
    ("sim", "--port"): "name it in the address: msggen sim udp://127.0.0.1:PORT",
    ("sim", "--link"): "write the address alone: msggen sim udp://127.0.0.1:8888",
    ("sim", "--vehicles"): "use --count",
    ("sim", "--release"): "use --px4",
    **dict.fromkeys(((name, "--dry-run") for name in ("build", "bump", "docs", "render", "sync")), "use --check"),
    ("sync", "--package"): "use --ros-package",
    ("link stop", "--link"): "write the address alone: msggen link stop udp://127.0.0.1:8888",
}
"""What to do about an argument, by command and word."""


_NEAR = 0.75
"""How similar the options of a command with parameters must be to be suggested."""
_MOST = 4
"""The most names of commands that a hint lists with their actions."""


def hint_for(parser: Any, wrong: str, given: Sequence[str], all_commands: Callable[[], Any]) -> str:
    """Return the end of the message about `wrong`, after the arguments `given`. `all_commands` makes their parser.

    It says to use a similar option, to name the firmware with --px4, or to give fewer names.
    """
    return (
        _of_other_programs(parser, wrong, given)
        or _of_further_file(parser, wrong)
        or _hint_for(parser, wrong, given, all_commands)
    )


def _hint_for(parser: Any, wrong: str, given: Sequence[str], all_commands: Callable[[], Any]) -> str:
    names = [str(action.metavar) for action in parser._actions if not action.option_strings]  # noqa: SLF001
    known = parser._option_string_actions  # noqa: SLF001 - argparse has no public name
    has_commands = bool(parser._subparsers)  # noqa: SLF001
    if wrong.endswith((".j2", ".em")) and "--template" in known:
        return f": name the template with --template {wrong}"
    if not wrong.startswith("-") and "--px4" in known and "--link" not in known:
        firmware = next(filter(_is_firmware, [*given, wrong]), None) if names else wrong
        if firmware:
            return f": name the firmware with --px4 {firmware}"
    owners = "" if has_commands else ", ".join(_commands_with(wrong, all_commands()))
    if owners:
        return f": an option of {owners}"
    near = suggestion(wrong, [name for name, action in known.items() if action.help is not argparse.SUPPRESS])
    if near or not names:
        return near
    if wrong.startswith("-"):
        return f": name {'an action' if names == ['ACTION'] else 'a command'} first" if has_commands else ""
    return f": expected {f'one {names[0]} per run' if len(names) == 1 else ' and '.join(names)}"


def error_for_choice(value: str, choices: Sequence[str], *, kind: str = "") -> str:
    """Return the message about a word that is none of the choices of an argument.

    `kind` is "command" or "action" if it stands in the place of one.
    """
    is_command, pointer = kind == "command", COMMANDS.get(value.lower())
    if kind and pointer:
        return f"no {kind} {value!r}: {pointer}"
    command = ACTIONS.get(value, "") if is_command else ""
    near = suggestion(SYNONYMS.get(value, value), choices)
    hint = f", did you mean '{command} {value}'?" if command in choices else near
    return f"invalid choice: {value!r}{hint} (choose from {', '.join(choices)})"


def _of_other_programs(parser: Any, wrong: str, given: Sequence[str]) -> str:
    """Return what to do about a word that other programs have, "" for other words."""
    command, known = parser.prog.partition(" ")[2], parser._option_string_actions  # noqa: SLF001
    types = [word for word in given if "/msg/" in word]
    if command == "topic pub" and types:
        return f": leave out the type, {types[0]}: the topic has it"
    if wrong == "--port" and "--link" in known:
        return ": name it with --link udp://127.0.0.1:PORT"
    if command == "command" and wrong.startswith("--") and not get_close_matches(wrong, known, cutoff=_NEAR):
        return f": write a parameter without dashes, {wrong[2:].replace('-', '_')}=VALUE"
    other = ARGUMENTS.get((command, wrong))
    return f": {other}" if other else ""


def _of_further_file(parser: Any, wrong: str) -> str:
    """Return what to do about a second recording, "" for other words."""
    takes_one = parser.prog.startswith("msggen log ") and "\0" not in wrong and os.path.isfile(wrong)
    return f": {parser.prog} reads one recording: run it for each file" if takes_one else ""


def hint_for_second_value(wrong: str, words: Sequence[str]) -> str:
    """Return what to do about a second value of --select, --ignore or --against in `words`; "" if it is none."""
    values = {name: [*filter(None, [value]), *rest] for name, value, rest in _values(words)}
    for option in ("--select", "--ignore"):
        if wrong in values.get(option, ()):
            rules = ",".join(value.strip(",") for value in values[option])
            return f"separate rules by commas: {option} {rules}"
    folder = next(iter(values.get("--px4", ())), os.curdir)
    is_folder = "\0" not in folder and os.path.isdir(folder)
    if "--against" in values and not os.path.exists(wrong) and is_folder and is_revision(folder, wrong):
        return f"--against names one side, name the other with --px4 {folder}@{wrong}"
    return ""


def _is_firmware(word: str) -> bool:
    return names_release(word) or names_installed(word) or ("\0" not in word and is_firmware(Folder(word)))


def _commands_with(option: str, parser: Any) -> list[str]:
    """Return the names of the commands that have an option, and list it in their help.

    Of many actions, only the command is named: `topic` for `topic hz`, `topic bw` and so on.
    """
    known = ((name, command._option_string_actions.get(option)) for name, command in _commands(parser))  # noqa: SLF001
    names = [name for name, action in known if action and action.help is not argparse.SUPPRESS]
    return names if len(names) <= _MOST else [*dict.fromkeys(name.partition(" ")[0] for name in names)]


def _commands(parser: Any, front: str = "") -> Iterator[tuple[str, Any]]:
    """Yield all commands by their words: `build`, `topic list`."""
    for action in parser._actions:  # noqa: SLF001
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            for name, command in action.choices.items():
                yield f"{front}{name}", command
                yield from _commands(command, f"{front}{name} ")


def _values(words: Sequence[str]) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Yield each long option in `words`, its value after `=`, and the words up to the next option."""
    starts = [index for index, word in enumerate(words) if word.startswith("-")]
    for start, end in zip(starts, [*starts[1:], len(words)], strict=False):
        name, _, value = words[start].partition("=")
        yield name, value, words[start + 1 : end]
