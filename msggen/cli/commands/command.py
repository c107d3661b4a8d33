"""`msggen command`: send a command to a running vehicle."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.base.diagnostics import suggestion
from msggen.base.exit_codes import DONE, FINDINGS
from msggen.base.foreign import Styled, escaped
from msggen.cli.chosen_types import expected_types
from msggen.cli.link import Connection, add_link, connection
from msggen.cli.message import add_timeout, settle
from msggen.cli.names import names_of
from msggen.cli.options import FAILED_CODES, Run, add_flag, add_shared, add_value, new_command, refuse
from msggen.cli.table import BOLD, styled
from msggen.cli.values import Deferred, non_empty
from msggen.messages.nav_states import MODE_NAMES, SELECTABLE, TAKEOFF, mode_number
from msggen.show.report.json import dump

if TYPE_CHECKING:
    from msggen.messages.packages import Message

_PREFIXES = ("VEHICLE_CMD_", "MAV_CMD_")
_MOST_IDS = 255
_NUMBERS = ("result_param1", "result_param2")
"""The fields of VehicleCommandAck that say more about a result."""

SHORT: Mapping[str, tuple[str, ...]] = {
    "arm": ("COMPONENT_ARM_DISARM", "param1=1"),
    "disarm": ("COMPONENT_ARM_DISARM", "param1=0"),
    "land": ("NAV_LAND",),
    "rtl": ("NAV_RETURN_TO_LAUNCH",),
    "takeoff": ("NAV_TAKEOFF",),
}
"""Short names of commands, some with a parameter."""
_MODE = "mode"
"""The short name of the command that selects the mode whose name follows."""
_SELECT = "SET_NAV_STATE"
_EXPLAINED = ("TEMPORARILY_REJECTED", "DENIED")
"""The results whose reasons a vehicle shows."""


@new_command(
    "command",
    "send a command such as NAV_TAKEOFF to a running vehicle",
    "Send a VehicleCommand to a running vehicle, and print how it is acknowledged. Parameters have "
    "names, which --list shows with their units; those that are not given are NaN, not set. The command is "
    "published, so it works in every session, unlike msggen call. A program that flies uses the actions, the "
    "Offboard mode and the flight modes of msggen.flight instead, which wait until they are done (docs/flight.md).",
    epilog=f"Exit codes: 0 accepted, 1 not accepted or not answered, {FAILED_CODES}",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    add_value(
        parser, "command", "COMMAND", non_empty, f"such as NAV_TAKEOFF, or {', '.join((*SHORT, _MODE))}", nargs="?"
    )
    text = (
        "parameters of the command, such as altitude=500, and fields of VehicleCommand; after mode, the name of a "
        "mode, such as hold; after takeoff, a height in m above the ground"
    )
    add_value(parser, "parameters", "NAME=VALUE", non_empty, text, nargs="*")
    add_flag(parser, "--list", "list all commands, or the parameters of one")
    text = "ids of the vehicle, 0 for all (default: those in its VehicleStatus)"
    add_value(parser, "--target", "SYSTEM[:COMPONENT]", _target, text)
    add_timeout(parser)
    add_shared(parser, "--json")
    add_link(parser)
    return _command


def _command(options: argparse.Namespace) -> int:
    if options.list or options.command is None:
        expected = expected_types(options).package
        rows = _all(expected) if options.command is None else _one(_found(options, expected))
        print(*map(Styled, rows), sep="\n")
        return DONE
    with connection(options, lambda package: _message(options, package, (1, 1)), acts=True) as found:
        return _send(options, found)


def _package(found: Connection) -> ModuleType:
    """Return the package with the VehicleCommand of the vehicle, which is waited for."""
    from msggen.messages.lookup import named_topic
    from msggen.messages.packages import package_of_class
    from msggen.vehicle.command import COMMAND

    topic = named_topic(COMMAND, "in", found.package, found.vehicle.routes)
    message = settle(found, topic).message
    return found.package if message is None else package_of_class(message)


class _Outcome(NamedTuple):
    """How a command was answered: a result by name, and a text that says more."""

    result: str
    text: str
    answer: Any = None
    reasons: Sequence[str] = ()
    """Why the vehicle refuses it, as far as it shows that."""


def _send(options: argparse.Namespace, found: Connection) -> int:
    """Send the command, and print the answer."""
    from msggen.vehicle.command import address_of, altitude_above

    if found.has_one_package:
        _message(options, found.package, (1, 1))  # errors are told before the vehicle has told its definition
    package = _package(found)
    message: Any = _message(options, package, options.target or address_of(found.vehicle))
    height = _wanted(options).height
    if height is not None:
        message.param7 = altitude_above(found.vehicle, height)
    name = _found(options, package).name
    outcome = _outcome(options, found, name, message)
    if options.json:
        numbers = {each: getattr(outcome.answer, each, None) for each in _NUMBERS}
        about = {
            "command": name,
            "target_system": message.target_system,
            "result": outcome.result,
            "reasons": [*outcome.reasons],
        }
        print(dump(about | numbers))
    elif outcome.answer is None:
        print(f"{name}: {outcome.text}", file=sys.stderr)
    else:
        print(f"{name}: {': '.join(filter(None, [outcome.result + outcome.text, ', '.join(outcome.reasons)]))}")
    return DONE if outcome.result == "ACCEPTED" else FINDINGS


def _outcome(options: argparse.Namespace, found: Connection, name: str, message: Any) -> _Outcome:
    """Send the command, and wait for the answer."""
    from msggen.link.link import LinkTimeoutError
    from msggen.messages.packages import package_of_class
    from msggen.vehicle.command import COMMAND, acknowledges, reasons_of, send_command

    def progress(answer: Any) -> None:
        if not options.json:
            print(f"{name}: IN_PROGRESS{_details(answer)}", flush=True)

    if not acknowledges(found.vehicle):
        found.vehicle.publish(message, COMMAND)
        return _Outcome("UNKNOWN", "sent; the firmware publishes no acknowledgements, as none before v1.15")
    try:
        answer = send_command(found.vehicle, message, options.timeout, progress)
    except LinkTimeoutError as error:
        return _Outcome("NONE", f"{error} for system {message.target_system}")
    result = str(package_of_class(type(answer)).meaning.of(answer, "result").name)  # or its number
    reasons = reasons_of(found.vehicle, message, f"`msggen command {_MODE} hold`") if result in _EXPLAINED else ()
    return _Outcome(result, _details(answer), answer, reasons)


def _details(answer: Any) -> str:
    """Return further numbers of an answer, which say why or how far."""
    found = [f"{name} {getattr(answer, name)}" for name in _NUMBERS if getattr(answer, name)]
    return f" ({', '.join(found)})" if found else ""


# The command


@Deferred
def _target(text: str) -> tuple[int, int]:
    system, _, component = text.partition(":")
    ids = [system, component or "1"]
    if not all(each.isascii() and each.isdecimal() and int(each) <= _MOST_IDS for each in ids):
        raise argparse.ArgumentTypeError(f"expected ids from 0 to {_MOST_IDS} such as 1 or 1:1, found {text!r}")
    return int(ids[0]), int(ids[1])


def _commands(package: ModuleType) -> dict[str, Any]:
    """Return the commands of a package by name. A package without VehicleCommand has none."""
    try:
        module = package.commands
    except (AttributeError, ImportError):
        return {}
    return {name: each for name, each in vars(module).items() if hasattr(each, "params") and not isinstance(each, type)}


class _Wanted(NamedTuple):
    """What the user asks for: a command by the name that it has in a package, and its parameters."""

    name: str
    words: Sequence[str]
    height: float | None = None
    """In m above where the vehicle is, for a takeoff to there."""


def _wanted(options: argparse.Namespace) -> _Wanted:
    """Return what the user asks for. Raises WrongArgumentError for a wrong mode or height."""
    name, words = options.command, options.parameters
    if name.lower() == _MODE:
        number = _mode_named(options, next(iter(words), ""))
        words = words[1:]
        if number != TAKEOFF or not words:
            return _Wanted(_SELECT, [f"param1={number}", *words])
        name = "takeoff"
    plain, *first = _plain(name)
    if name.lower() == "takeoff" and words and "=" not in words[0]:
        return _Wanted(plain, words[1:], _height(options, words[0]))
    return _Wanted(plain, [*first, *words])


def _mode_named(options: argparse.Namespace, text: str) -> int:
    """Return the number of the mode that follows `mode`. Raises WrongArgumentError for an unknown one."""
    number = mode_number(text)
    if number is None:
        words = [*map(_word, SELECTABLE)]
        near = (text and suggestion(text, words)) or f": there are {', '.join(words)}"
        refuse(options, f"argument NAME=VALUE: no mode '{text}'{near}")
    return number


def _height(options: argparse.Namespace, text: str) -> float:
    """Return the height that follows `takeoff`. Raises WrongArgumentError unless it is a number above 0."""
    with suppress(ValueError):
        if 0.0 < float(text) < math.inf:
            return float(text)
    return refuse(
        options, f"argument NAME=VALUE: expected a height above the ground in m, as in takeoff 5, found '{text}'"
    )


def _found(options: argparse.Namespace, package: ModuleType) -> Any:
    """Return the command that the user names. Raises WrongArgumentError for a wrong name."""
    name, known = _wanted(options).name, _commands(package)
    if name not in known:
        refuse(options, f"argument COMMAND: no command '{options.command}'{_near(options.command, known)}")
    return known[name]


def _near(text: str, known: Iterable[str]) -> str:
    """Return what to write instead of a name that is not a command."""
    if text.lower() == _MODE:
        return f": the firmware has no {_SELECT}, as none before v1.15, and DO_SET_MODE takes PX4's numbers of modes"
    mode = mode_number(text)
    if mode is not None:
        return f": to select the mode, msggen command {_MODE} {_word(MODE_NAMES[mode])}"
    return suggestion(text, [*known, *SHORT, _MODE]) or ": msggen command --list has all"


def _word(mode: str) -> str:
    """Return the name of a mode as one word."""
    return mode.replace(" ", "-")


def _plain(text: str) -> Sequence[str]:
    """Return the name that a command has in the package, and the parameters that a short name stands for."""
    name, *first = SHORT.get(text.lower(), (text.upper(),))
    for prefix in _PREFIXES:
        name = name.removeprefix(prefix)
    return name, *first


def _message(options: argparse.Namespace, package: ModuleType, target: tuple[int, int]) -> Message:
    """Return the message with the parameters that the user gives. Raises WrongArgumentError for a wrong one."""
    command = _found(options, package)
    enums = {each.name: _enum(each, package) for each in command.params}
    enums |= {f"param{each.number}": enums[each.name] for each in command.params}
    values: dict[str, Any] = {}
    for word in _wanted(options).words:
        name, mark, text = word.partition("=")
        if not mark:
            refuse(options, f"argument NAME=VALUE: expected a name and a value such as altitude=5, found '{word}'")
        if name in values:
            refuse(options, f"argument NAME=VALUE: '{name}' is given more than once")
        values[name] = _value(options, name, text, enums.get(name))
    defaults = {
        "target_system": target[0],
        "target_component": target[1],
        "source_system": target[0] or 1,
        "source_component": 1,
        "from_external": True,
    }
    try:
        message: Message = command(**{**defaults, **values})
        message.encode()
    except (TypeError, ValueError) as error:
        refuse(options, f"argument NAME=VALUE: {error}")
    return message


def _enum(parameter: Any, package: ModuleType) -> Any:
    """Return the enum of a parameter. That of SET_NAV_STATE is an enum of VehicleStatus."""
    is_mode = parameter.name in ("nav_state", "navigation_state_value")
    return package.VehicleStatus.NavigationState if parameter.enum is None and is_mode else parameter.enum


def _value(options: argparse.Namespace, name: str, text: str, enum: Any) -> Any:
    """Return the number in a text, or that of a member of the enum of a parameter."""
    members = {} if enum is None else enum.__members__
    if text.upper() in members:
        return int(members[text.upper()])
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        near = suggestion(text, members) or (f": there are {', '.join(members)}" if members else "")
        refuse(options, f"argument NAME=VALUE: {name}: expected a number, found '{text}'{near}")


# The list


def _all(package: ModuleType) -> Iterator[str]:
    """Yield a line for each command: its name, and its parameters with their units."""
    known = _commands(package)
    width = max(map(len, known), default=0)
    for name, command in known.items():
        parameters = " ".join(f"{each.name}={each.unit or _kind(each)}" for each in command.params)
        yield f"{styled(f'{name:{width}}', BOLD)}  {escaped(parameters)}".rstrip()


def _one(command: Any) -> Iterator[str]:
    """Yield the description of a command, and a line for each parameter."""
    yield f"{styled(command.name, BOLD)} ({command.value}): {escaped(command.description)}"
    rows = [
        (each.name, f"param{each.number}", each.unit, each.range.replace(",", " to "), each) for each in command.params
    ]
    widths = [max((len(row[index]) for row in rows), default=0) for index in range(4)]
    for *cells, each in rows:
        members = "" if each.enum is None else f": {', '.join(each.enum.__members__)}"
        line = "  ".join(str(cell).ljust(width) for cell, width in zip(cells, widths, strict=True) if width)
        yield f"  {escaped(f'{line}  {each.description}{members}')}"


def _kind(parameter: Any) -> str:
    """Return what stands for the value of a parameter without a unit."""
    members: Sequence[str] = [] if parameter.enum is None else list(parameter.enum.__members__)
    return "|".join(members) if 0 < len(members) <= 4 else "NAME" if members else "N"  # noqa: PLR2004 - as fit in a line


# Completions


def _complete_command(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of commands."""
    yield from (*SHORT, _MODE)
    yield from names_of(options).commands


def _complete_parameter(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the parameters of the command with `=`, and the members of the enum of one."""
    if (options.command or "").lower() == _MODE:
        yield from map(_word, SELECTABLE)
        return
    name, *first = _plain(options.command or "")
    for each in names_of(options).commands.get(name, ()):
        if any(word.startswith(f"param{each.number}=") for word in first):
            continue  # the short name has its value
        yield f"{each.name}="
        if prefix.startswith(f"{each.name}="):
            yield from [f"{each.name}={member}" for member in each.members]


COMPLETERS: Mapping[str, Callable[[str, argparse.Namespace], Iterator[str]]] = {
    "command": _complete_command,
    "parameters": _complete_parameter,
}
"""The completions of arguments by their names in argparse."""
