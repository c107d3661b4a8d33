"""`msggen completion`, and the completions that a shell asks for."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping

from msggen.base.exit_codes import DONE
from msggen.base.foreign import unguarded
from msggen.cli.options import Commands, add_command

_SHELLS = ("bash", "zsh", "fish")
_CONTROL = frozenset(map(chr, (*range(0x20), *range(0x7F, 0xA0))))
"""Control characters. Paths keep other characters that are not printable, such as the spaces that macOS writes."""


def add_to(commands: Commands) -> None:
    """Add the command to the command line."""
    parser = add_command(
        commands,
        "completion",
        _completion,
        help="print the script that completes commands in a shell",
        description="Print the script with which a shell completes the commands of msggen, their options, and names of "
        "messages, topics, fields, releases, rules and boards. docs/build.md shows how to install it.",
    )
    parser.add_argument("shell", choices=_SHELLS, metavar="SHELL", help=", ".join(_SHELLS))


def _completion(options: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode

    print(shellcode(["msggen"], shell=options.shell), file=unguarded(sys.stdout))
    return DONE


def complete() -> None:
    """Write the completions of the command line that argcomplete finds in the environment, and exit."""
    import argcomplete
    from argcomplete.completers import DirectoriesCompleter

    from msggen.cli import parser_for
    from msggen.cli.commands.command import COMPLETERS as OF_COMMANDS
    from msggen.cli.completers import COMPLETERS

    live = {**COMPLETERS, **OF_COMMANDS}
    parser = parser_for([])
    for command in _commands(parser):
        for action in command._actions:  # noqa: SLF001 - argparse has no public name
            if isinstance(action, argparse._StoreAction):  # noqa: SLF001
                action.__class__ = argparse._StoreAction  # noqa: SLF001 - argcomplete stores values of no other class
            if action.dest in live:
                action.completer = _live(live[action.dest])  # type: ignore[attr-defined]
            elif action.dest in _NAMES:
                action.completer = _names_or_paths(_NAMES[action.dest])  # type: ignore[attr-defined]
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


def _names_or_paths(names: Callable[[argparse.Namespace], Iterable[str]]) -> Callable[..., list[str]]:
    """Return a completer of `names`, or of paths where a word looks like one. Without names, the shell reports none."""
    from argcomplete.completers import FilesCompleter

    from msggen.base.diagnostics import InputError

    def completer(prefix: str, parsed_args: argparse.Namespace, **_: object) -> list[str]:
        done, comma, word = prefix.rpartition(",")
        try:
            own = [name for name in names(parsed_args) if name.lower().startswith(word.lower()) and name.isprintable()]
        except (InputError, OSError):
            own = []
        return [f"{done}{comma}{name}" for name in own] or list(FilesCompleter()(prefix))

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


def _embedded(_: argparse.Namespace) -> Iterable[str]:
    from msggen.sources.embedded import EMBEDDED

    return EMBEDDED


def _revisions(options: argparse.Namespace) -> Iterable[str]:
    from msggen.base.disk.git import revisions

    return [*_embedded(options), *revisions(_sources(options) or os.curdir)]


def _rules(_: argparse.Namespace) -> Iterable[str]:
    from msggen.check.finding import Category
    from msggen.show.report.table import RULES

    return [*Category.__members__, *(rule.id for rule in RULES)]


def _explained(options: argparse.Namespace) -> Iterable[str]:
    from msggen.base.diagnostics import CODES
    from msggen.show.report.rules import MARKS

    return [*_rules(options), *(mark for mark in MARKS if " " not in mark), *CODES]


_NAMES: Mapping[str, Callable[[argparse.Namespace], Iterable[str]]] = {
    "px4": _embedded,
    "side": _embedded,
    "other": _embedded,
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
