"""`msggen completion`, and the completions that a shell asks for. They need neither a vehicle nor an import."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from msggen.base.foreign import unguarded
from msggen.cli.commands.call import request_like
from msggen.cli.message import values_like
from msggen.cli.names import names_of
from msggen.cli.options import Run, new_command

if TYPE_CHECKING:
    from msggen.cli.names import Field, Names
    from msggen.messages.packages import Way
    from msggen.recordings import Topic

_SHELLS = ("bash", "zsh", "fish")
_CONTROL = frozenset(map(chr, (*range(0x20), *range(0x7F, 0xA0))))
"""Control characters. Paths keep other characters that are not printable, such as the spaces that macOS writes."""


@new_command(
    "completion",
    "print the script that completes commands in a shell",
    "Print the script with which a shell completes the commands of msggen, their options, and names of "
    "messages, topics, fields, releases, rules and boards. docs/build.md shows how to install it.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    parser.add_argument("shell", choices=_SHELLS, metavar="SHELL", help=", ".join(_SHELLS))
    return _completion


def _completion(options: argparse.Namespace) -> None:
    from argcomplete.shell_integration import shellcode

    print(shellcode(["msggen"], shell=options.shell), file=unguarded(sys.stdout))


def complete() -> None:
    """Write the completions of the command line that argcomplete finds in the environment, and exit."""
    import argcomplete
    from argcomplete.completers import DirectoriesCompleter

    from msggen.cli import parser_for
    from msggen.cli.commands.command import COMPLETERS as OF_COMMANDS

    live = {**COMPLETERS, **OF_COMMANDS}
    parser = parser_for([])
    for command in _commands(parser):
        for action in command._actions:  # noqa: SLF001 - argparse has no public name
            if isinstance(action, argparse._StoreAction):  # noqa: SLF001
                action.__class__ = argparse._StoreAction  # noqa: SLF001 - argcomplete stores values of no other class
            if action.dest in live:
                action.completer = _live(live[action.dest])  # type: ignore[attr-defined]
            elif action.dest in _NAMES:
                action.completer = _names_or_paths(_NAMES[action.dest], action.dest)  # type: ignore[attr-defined]
            elif action.metavar in ("DIR", "PKG"):
                action.completer = DirectoriesCompleter()  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options="long", validator=_is_proposed)


def _is_proposed(completion: str, prefix: str) -> bool:
    """Whether a completion begins with `prefix`, and has no control character: the shell would print it as it is."""
    return completion.startswith(prefix) and not any(map(_CONTROL.__contains__, completion))


def _commands(parser: argparse.ArgumentParser) -> Iterable[argparse.ArgumentParser]:
    for action in parser._actions:  # noqa: SLF001 - argparse has no public name
        if action.nargs == argparse.PARSER:
            for command in dict(action.choices or {}).values():
                yield command
                yield from _commands(command)


def _live(names: Callable[[str, argparse.Namespace], Iterable[str]]) -> Callable[..., list[str]]:
    """Return a completer of names that types have. Without the types, or a topic, there are none."""
    from msggen.base.diagnostics import InputError

    def completer(prefix: str, parsed_args: argparse.Namespace, **_: object) -> list[str]:
        try:
            found = dict.fromkeys(names(prefix, parsed_args))
        except (ImportError, InputError, KeyError, OSError, SystemExit, ValueError):  # also of a recording
            return []
        return [name for name in found if name.lower().startswith(prefix.lower()) and name.isprintable()]

    return completer


def _names_or_paths(names: Callable[[argparse.Namespace], Iterable[str]], dest: str) -> Callable[..., list[str]]:
    """Return a completer of `names`, or of paths where a word looks like one. Without names, the shell reports none.

    A source that someone has begun to write can be both: `inst` is the beginning of `installed` and of `install/`.
    """
    from argcomplete.completers import FilesCompleter

    from msggen.base.diagnostics import InputError

    def completer(prefix: str, parsed_args: argparse.Namespace, **_: object) -> list[str]:
        done, comma, word = prefix.rpartition(",")
        try:
            own = [name for name in names(parsed_args) if name.lower().startswith(word.lower()) and name.isprintable()]
        except (InputError, OSError):
            own = []
        found = [f"{done}{comma}{name}" for name in own]
        return [*found, *FilesCompleter()(prefix)] if not found or (word and dest in _SOURCES) else found

    return completer


def _sources(options: argparse.Namespace) -> str | None:
    from msggen.sources.settings import read_settings

    return getattr(options, "px4", None) or read_settings(".").px4


def _messages(options: argparse.Namespace) -> Iterable[str]:
    from msggen.cli.source_options import source_here
    from msggen.sources.finding import find_sources

    return [file.stem for file in find_sources(_sources(options) or source_here()).messages]


def _versioned(options: argparse.Namespace) -> Iterable[str]:
    from msggen.sources.tree import Folder

    names = Folder(_sources(options) or os.curdir).names("msg/versioned/")
    return [name.removesuffix(".msg") for name in names if name.endswith(".msg")]


def _boards(options: argparse.Namespace) -> Iterable[str]:
    from msggen.sources.board import boards_of
    from msggen.sources.tree import Folder

    return boards_of(Folder(_sources(options) or os.curdir))


def _releases(_: argparse.Namespace) -> Iterable[str]:
    from msggen.sources.finding import RELEASES

    return RELEASES


def _named(_: argparse.Namespace) -> Iterable[str]:
    from msggen.sources.embedded import EMBEDDED
    from msggen.sources.installed import INSTALLED

    return [*EMBEDDED, INSTALLED]


def _revisions(options: argparse.Namespace) -> Iterable[str]:
    from msggen.base.disk.git import revisions

    return [*_named(options), *revisions(_sources(options) or os.curdir)]


def _rules(_: argparse.Namespace) -> Iterable[str]:
    from msggen.check.finding import Category
    from msggen.show.report.table import RULES

    return [*Category.__members__, *(rule.id for rule in RULES)]


def _explained(options: argparse.Namespace) -> Iterable[str]:
    from msggen.base.diagnostics import CODES
    from msggen.show.report.explained import OF_COMMANDS
    from msggen.show.report.rules import MARKS

    return [*_rules(options), *(each for each in (*MARKS, *OF_COMMANDS) if " " not in each), *CODES]


_NAMES: Mapping[str, Callable[[argparse.Namespace], Iterable[str]]] = {
    "px4": _named,
    "side": _named,
    "other": _named,
    "against": _revisions,
    "release": _releases,
    "board": _boards,
    "message": _versioned,
    "messages": _messages,
    "rule": _explained,
    "select": _rules,
    "ignore": _rules,
}
"""The names that complete the value of an argument, by its name in argparse. Paths complete the others."""

_SOURCES = ("px4", "side", "other", "against")
"""Those that are also paths."""


_WORD = re.compile(r"[\w.\[\]]*\Z")
_COMPARED = re.compile(r"([\w.\[\]]+)\s*(?:[=!<>]=|[<>&]|(?:not\s+)?in\s*\([^()]*)\s*\Z")
"""The value whose enum has the members that come next: before `==`, or before `in (A, `."""


def topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield names of topics: those of uORB, or those of ROS 2 after a `/`.

    A topic to print is one that PX4 publishes, or, if its name begins so, one that programs publish to PX4.
    """
    if getattr(options, "file", None):
        yield from recorded_topics(prefix, options)
        return
    ways: tuple[str, ...] = ("out", "in")
    if hasattr(options, "filter") or hasattr(options, "topics"):
        ways = ("in",) if prefix.startswith("/fmu/in") else ("out",)
    elif hasattr(options, "values"):
        ways = ("in",)
    for endpoint in names_of(options).endpoints:
        if endpoint.direction in ways:
            yield endpoint.ros_name if prefix.startswith("/") else endpoint.uorb_topic
    if hasattr(options, "filter") and len(options.topics or ()) == 1:  # a condition behind a topic
        with suppress(KeyError):
            yield from conditions(prefix, options)


def messages(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the messages of topics."""
    for endpoint in names_of(options).endpoints:
        yield endpoint.message.rpartition("/")[2]


def fields(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of values of the topic."""
    if getattr(options, "file", None):
        yield from recorded_fields(prefix, options)
        return
    names = names_of(options)
    yield from _paths(prefix, names, _fields(options, names))


def conditions(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield a condition with its last word completed: a field, a member of the enum of the other side, a function."""
    from msggen.messages.expression import FUNCTIONS

    names = names_of(options)
    own = _fields(options, names)
    found = _WORD.search(prefix)
    start, word = (prefix[: found.start()], found[0]) if found else (prefix, "")
    compared = _COMPARED.search(start)
    if compared is not None:
        front, _, last = compared[1].rpartition(".")
        members = names.fields_in(own, front)[last.partition("[")[0]].members
        if members:
            yield from [f"{start}{name}" for name in members]
            return
    yield from [f"{start}{name}" for name in _paths(word, names, own)]
    yield from [f"{start}{name}(" for name in FUNCTIONS]


def values(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield values in YAML with the last word completed, of the topic to publish or of the service to call."""
    names = names_of(options)
    own = _fields(options, names, "in") if hasattr(options, "topic") else request_like(options, names)
    yield from values_like(prefix, own, names)


def _fields(options: argparse.Namespace, names: Names, way: Way = "out") -> Mapping[str, Field]:
    """Return the fields of the topic in the options. Raises KeyError."""
    several = getattr(options, "topics", None)
    return names.fields_of_topic((several[0] if several else options.topic) or "", way)


def _paths(prefix: str, names: Names, own: Mapping[str, Field]) -> Iterator[str]:
    front, dot, last = prefix.rpartition(".")
    for name, field in names.fields_in(own, front).items():
        yield f"{front}{dot}{name}"
        if last.startswith(name):
            yield from [f"{front}{dot}{name}[{index}]" for index in range(field.length)]


def recorded_topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the topics in the recording of the options: of uORB, or those in the file after a `/`."""
    from msggen import recordings

    with recordings.open(options.file) as log:
        for topic in log.topics:
            yield topic.name if prefix.startswith("/") else _numbered(topic)


def recorded_fields(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the columns of the topics in the options, or of all."""
    from msggen import recordings
    from msggen.recordings.columns.arrays import names_of

    with recordings.open(options.file) as log:
        chosen = [options.topic] if getattr(options, "topic", None) else getattr(options, "topics", None)
        for topic in log.chosen(chosen or None):
            yield from names_of(log.dtype(topic))


def recorded_paths(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of columns of all topics, `vehicle_status.nav_state`, and what else `log plot` draws."""
    if not hasattr(options, "file"):
        yield from _live_paths(prefix, options)
        return
    from msggen import recordings
    from msggen.analysis.motion import SENSORS
    from msggen.exports.pictures import PICTURES
    from msggen.recordings.columns.arrays import names_of

    first = next(iter(options.fields or ()), "")
    if not first:
        yield from PICTURES
    with recordings.open(options.file) as log:
        if first in PICTURES:
            known = {name for sensor in SENSORS for name in (sensor.name, *sensor.names)}
            recorded = [sensor.name for sensor in SENSORS] + [_numbered(topic) for topic in log.topics]
            taken = recorded if PICTURES[first].takes_sources else ()
            yield from [name for name in taken if name.partition("[")[0] in known]
            return
        for topic in log.chosen(None):
            name = topic.name if prefix.startswith("/") else _numbered(topic)
            yield from [f"{name}.{column}" for column in names_of(log.dtype(topic))]


def _live_paths(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of the fields of the topic in `prefix`, or of all that PX4 publishes."""
    topic, dot, path = prefix.partition(".")
    names = names_of(options)
    for each in [topic] if dot else topics(prefix, argparse.Namespace(**vars(options), topics=())):
        yield from [f"{each}.{rest}" for rest in _paths(path, names, names.fields_of_topic(each, "out"))]


def _numbered(topic: Topic) -> str:
    """Return the name of a topic in uORB, with its instance: `sensor_gps[1]`."""
    return f"{topic.uorb}[{topic.instance}]" if topic.instance else topic.uorb


COMPLETERS: Mapping[str, Callable[[str, argparse.Namespace], Iterator[str]]] = {
    "topic": topics,
    "topics": topics,
    "message_type": messages,
    "field": fields,
    "fields": recorded_paths,
    "filter": conditions,
    "values": values,
}
"""The completions of arguments by their names in argparse."""
