"""The choice of rules by `--select`, `--ignore` and the settings of the same names."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING

from msggen.cli.options import non_empty
from msggen.diagnostics import Diagnostic, InputError, suggestion
from msggen.location import Location
from msggen.settings import Settings

if TYPE_CHECKING:
    from msggen.finding import Rule


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add the options that select rules."""
    choice = parser.add_argument_group("rules")
    text = "rules or categories to apply (default: all that are not optional)"
    choice.add_argument("--select", metavar="RULE,...", type=_list, help=text)
    choice.add_argument("--ignore", metavar="RULE,...", type=_list, help="rules or categories to leave out")


def _list(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in non_empty(text).split(","))


def selected_rules(
    command: str, options: argparse.Namespace, settings: Settings
) -> tuple[tuple[Rule, ...], dict[str, list[Rule]]]:
    """Return the rules that `command` applies, and those to ignore by message. Raises InputError with all errors.

    `breaking` and `lint` have the same settings, so that each of them leaves out the rules of the other. An option
    must name rules of the command.
    """
    from msggen.rules import COMMANDS, named

    own = COMMANDS[command]
    settable = {rule.id for name in ("breaking", "lint") for rule in COMMANDS[name]}
    errors: list[Diagnostic] = []

    def all_named(key: str, names: Iterable[str] | None, option: Iterable[str] | None = None) -> set[str]:
        place = settings.place(key) if option is None else Location(f"--{key}", 0)
        allowed = settable if option is None else {rule.id for rule in own}
        found = {
            name: {rule.id for rule in named(name)} & allowed for name in (names if option is None else option) or ()
        }
        errors.extend(Diagnostic(place, "C104", _unknown(name, command)) for name, ids in found.items() if not ids)
        return {each for ids in found.values() for each in ids}

    selected = all_named("select", settings.select, options.select)
    ignored = all_named("ignore", settings.ignore, options.ignore)
    by_message = {
        message: all_named("per-message-ignores", names) for message, names in settings.per_message_ignores.items()
    }
    if errors:
        raise InputError(errors)
    rules = [rule for rule in own if rule.id in selected] or [rule for rule in own if rule.is_default]
    applied = tuple(rule for rule in rules if rule.id not in ignored)
    return applied, {message: [rule for rule in own if rule.id in ids] for message, ids in by_message.items()}


def _unknown(name: str, command: str) -> str:
    from msggen.rules import COMMANDS, commands_of, named

    rules = named(name)
    if rules:
        return f"'{name}' is a rule of {' and '.join(commands_of(rules[0]))} only"
    known = [*(rule.category.name for rule in COMMANDS[command]), *(rule.id for rule in COMMANDS[command])]
    return f"unknown rule '{name}'{suggestion(name, known)}"
