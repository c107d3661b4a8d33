"""The parser of the command line, which suggests the nearest name for an unknown word.

It uses argparse, because larger libraries take longer to import than a build with nothing to do (docs/libraries.md).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from itertools import chain
from typing import Any, NoReturn

from msggen.base.diagnostics import Diagnostic, printable
from msggen.base.exit_codes import FAILED
from msggen.base.foreign import Styled, escaped, without_secrets
from msggen.base.location import Location
from msggen.base.version import __version__
from msggen.cli.options import FAILED_CODES
from msggen.cli.printing import colour, print_document, terminal_width
from msggen.cli.values import Deferred

_GROUPS = {
    "Types": ("build", "render", "docs", "px4-generate"),
    "Firmware in step": ("sync", "check", "breaking", "lint", "bump", "lsp"),
    "Vehicle": ("topic", "top", "view", "command", "call", "doctor", "link", "relay", "sim", "mission"),
    "Recordings": ("record", "play", "log", "mcp"),
    "Help": ("releases", "settings", "rules", "explain", "completion"),
}
"""The commands by the group in the help."""
_NAMES = tuple(chain.from_iterable(_GROUPS.values()))
_MODULES = {**{name: name.replace("-", "_") for name in _NAMES}, "link": "links", "explain": "rules"}
"""The module of each command."""
_COMMAND = "COMMAND"


def output_format_of(words: Sequence[str]) -> str:
    """Return the value of --output-format, also from arguments that cannot be parsed."""
    found = ""
    for word, after in zip(words, [*words[1:], ""], strict=False):
        name, mark, value = word.partition("=")
        if name == "--output-format":
            found = value if mark else after
        elif word == "--json" and words[0] in ("doctor", "log", "mission"):  # where it stands for --output-format json
            found = "json"
    return found


class _Formatter(argparse.HelpFormatter):
    """A formatter that keeps the longest command on one line with its help."""

    def add_argument(self, action: argparse.Action) -> None:
        super().add_argument(action)
        if action.nargs == argparse.PARSER:
            self._action_max_length += 2  # argparse ignores the indentation of commands

    def _format_action(self, action: argparse.Action) -> str:
        if action.metavar != _COMMAND or action.nargs != argparse.PARSER:
            return super()._format_action(action)
        commands = {each.dest: each for each in self._iter_indented_subactions(action)}
        parts = []
        for title, names in _GROUPS.items():
            parts.append(f"{'':{self._current_indent}}{title}\n")
            self._indent()
            parts += [self._format_action(commands[name]) for name in names if name in commands]
            self._dedent()
        return "".join(parts)


class _StoreOnce(argparse._StoreAction):  # noqa: SLF001 - argparse has no public name
    """An argument with a single value. A second value is an error, because one of them would be ignored."""

    def __call__(
        self, parser: Any, namespace: argparse.Namespace, values: Any, option_string: str | None = None
    ) -> None:
        if option_string and self.dest in parser.given:
            raise argparse.ArgumentError(self, "given more than once")
        parser.given.add(self.dest)
        super().__call__(parser, namespace, values, option_string)


class _Parser(argparse.ArgumentParser):
    """A parser that suggests the nearest option, choice of an option, or command.

    It reports unknown arguments before the errors that follow from them, such as a missing option. It reports errors in
    `output_format` too, if that is a format for programs. `given` are the arguments with a single value so far.
    """

    def __init__(self, *, output_format: str = "", **about: Any) -> None:
        self._output_format = output_format
        width = terminal_width(80) - 2  # once, because argparse makes a formatter for each option

        def formatter(prog: str) -> argparse.HelpFormatter:
            return _Formatter(prog, width=width)

        if sys.version_info >= (3, 14):  # where argparse has colours
            about["color"] = colour(sys.stdout)
        super().__init__(formatter_class=formatter, allow_abbrev=False, **about)
        self.given: set[str] = set()
        for name in (None, "store"):
            self.register("action", name, _StoreOnce)

    def add_subparsers(self, **about: Any) -> Any:
        subparser: Any = partial(_Parser, output_format=self._output_format)
        return super().add_subparsers(parser_class=subparser, **about)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        for word in args[:1] if self._subparsers else args:  # the others belong to the command
            if word == "--":
                break
            if self._is_unknown(word):
                self._refuse(word)
        positional = [action for action in self._actions if not action.option_strings]
        if not positional:
            self._check_stray(args)
        self.given.clear()
        if any(
            action.nargs in (argparse.OPTIONAL, argparse.ZERO_OR_MORE, argparse.ONE_OR_MORE) for action in positional
        ):
            args = self._options_first(args)
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self._refuse(unknown[0], [str(getattr(options, action.dest, "")) for action in positional])
        self._convert(options)
        return options, unknown

    def _convert(self, options: argparse.Namespace) -> None:
        """Convert the texts of options whose types are deferred."""
        for action in self._actions:
            if isinstance(action.type, Deferred):
                try:
                    setattr(options, action.dest, action.type.value(getattr(options, action.dest)))
                except argparse.ArgumentTypeError as error:
                    self.error(f"argument {action.option_strings[-1]}: {error}")

    def _check_stray(self, words: Sequence[str]) -> None:
        """Refuse a word that is neither an option nor a value of one."""
        option, room = "", 0
        for word in words[: words.index("--") if "--" in words else None]:
            name, value = self._split(word)
            if name:
                option, nargs = name, self._option_string_actions[name].nargs
                room = 0 if value or nargs == 0 else 1 if nargs is None else len(words)
            elif room:
                room -= 1
            else:
                self._refuse_second_value(word, words)
                self._refuse(word, after=option)

    def _options_first(self, words: Sequence[str]) -> Sequence[str]:
        """Return the words with all values of arguments at the end.

        argparse takes an argument that may be missing as missing if an option follows: `echo TOPIC --once FILTER`.
        """
        end = words.index("--") if "--" in words else len(words)
        options: list[str] = []
        values: list[str] = []
        room = 0
        for word in words[:end]:
            name, value = self._split(word)
            if name:
                nargs = self._option_string_actions[name].nargs
                if nargs not in (None, 0):
                    return words
                room = int(nargs is None and not value)
                options.append(word)
            else:
                (options if room else values).append(word)
                room = 0
        return words if room else [*options, *values, *words[end:]]  # an option without its value stays the last

    def _split(self, word: str) -> tuple[str, str]:
        """Return the last option in `word` and the value that is attached to it, or "" and `word` for a value."""
        known = self._option_string_actions
        while word[1:2] not in ("", "-") and word not in known and word[:2] in known and known[word[:2]].nargs == 0:
            word = f"-{word[2:]}"
        name, value = (word[:2], word[2:]) if word[1:2] != "-" else (word.partition("=")[::2])
        return (name, value) if name in known else ("", word)

    def _is_unknown(self, word: str) -> bool:
        """Whether `word` is an option that this parser does not have. For argparse, a word with a space is a value."""
        is_long = word.startswith("--")
        name = word.partition("=")[0] if is_long else word[:2]
        is_option = is_long or (word.startswith("-") and word[1:2].isalpha())
        return is_option and " " not in word and name not in self._option_string_actions

    def _refuse(self, wrong: str, given: Sequence[str] = (), after: str = "") -> NoReturn:
        """Report the unknown argument `wrong` without its value, after the arguments `given` and the option `after`."""
        from msggen.cli.unknown_argument import hint_for

        wrong = wrong.partition("=")[0] if wrong.startswith("-") else wrong
        is_repeatable = isinstance(self._option_string_actions.get(after), argparse._AppendAction)  # noqa: SLF001
        hint = (
            f": repeat the option, {after} {wrong}"
            if is_repeatable
            else hint_for(self, wrong, given, partial(parser_for, ()))
        )
        self.error(f"unknown argument '{printable(wrong)}'{printable(hint)}")

    def _refuse_second_value(self, wrong: str, words: Sequence[str]) -> None:
        """Report a second value of --select, --ignore or --against, an option of a command without other arguments."""
        from msggen.cli.unknown_argument import hint_for_second_value

        hint = hint_for_second_value(wrong, words)
        if hint:
            self.error(f"unknown argument '{printable(wrong)}': {printable(hint)}")

    def _print_message(self, message: str, file: Any = None) -> None:
        super()._print_message(Styled(message), file)

    def error(self, message: str) -> NoReturn:
        for option, hint in (self.get_default("hints") or {}).items():
            message += f": {hint}" if message.startswith("the following arguments") and option in message else ""
        message = without_secrets(message)
        print_document([Diagnostic(Location(self.prog, 0), "usage", message)], self._output_format)
        self.exit(FAILED, f"{self.prog}: error: {escaped(message)}\nfor all arguments: {self.prog} --help\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            from msggen.cli.unknown_argument import error_for_choice

            kind = str(action.metavar).lower() if action.nargs == argparse.PARSER else ""
            raise argparse.ArgumentError(
                action, error_for_choice(str(value), list(map(str, action.choices)), kind=kind)
            )


class _PrintCMakeFolder(argparse.Action):
    """An option that prints the folder of msggenConfig.cmake and exits."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "cmake"))
        parser.exit()


def parser_for(words: Sequence[str]) -> argparse.ArgumentParser:
    """Return a parser of the command that `words` start with, or of all commands if they start with none.

    Adding a command takes time, so the others are not added.
    """
    output_format = output_format_of(words)
    parser = _Parser(
        output_format=output_format,
        prog="msggen",
        description="Generate Python types, CDR codecs and a topic registry from PX4's message definitions, and keep "
        "ROS 2 packages up to date with them.",
        epilog=f"Exit codes: 0 done, 1 findings or changes, {FAILED_CODES}",
    )
    parser.add_argument("-V", "--version", action="version", version=f"msggen {__version__}")
    parser.add_argument(
        "--cmake-dir", action=_PrintCMakeFolder, nargs=0, help="show the value for CMake's msggen_DIR and exit"
    )
    parser._positionals.title = "commands"  # noqa: SLF001 - a group of its own would come after the options
    commands = parser.add_subparsers(prog=parser.prog, metavar=_COMMAND, required=True)
    known = _MODULES.get(words[0]) if words else None
    for module in dict.fromkeys([known] if known else _MODULES.values()):
        __import__(f"msggen.cli.commands.{module}", fromlist=["add_to"]).add_to(commands)  # importlib would take longer
    return parser
