"""The rules of all commands, and their choice by `--select`, `--ignore` and the settings of the same names."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from types import MappingProxyType

from msggen.analysis.rules.table import FLIGHT
from msggen.base.diagnostics import Diagnostic, InputError, suggestion
from msggen.base.location import Location
from msggen.check.compare.rules import BREAKING, CHECKED
from msggen.check.compare.rules import RULES as OF_COMPARISONS
from msggen.check.finding import Rule, Severity
from msggen.check.lint.rules import LINT
from msggen.doctor.rules import DOCTOR, LIVE
from msggen.sources.settings import Settings

RULES = (*OF_COMPARISONS, *LINT, *DOCTOR, *FLIGHT)
"""All rules, in the order in which they are listed."""

COMMANDS: Mapping[str, tuple[Rule, ...]] = MappingProxyType(
    {
        "check": CHECKED,
        "breaking": BREAKING,
        "lint": LINT,
        "doctor": DOCTOR,
        "check --live": LIVE,
        "log findings": FLIGHT,
    }
)
"""The rules of each command."""


def named(name: str) -> tuple[Rule, ...]:
    """Return the rule with the ID `name`, or the rules in the category `name`, in any case; empty if neither exists."""
    return tuple(rule for rule in RULES if name.upper() in (rule.id, rule.category.name))


def commands_of(rule: Rule) -> dict[str, Severity]:
    """Return the commands that apply `rule`, with its severity."""
    return {command: each.severity for command, rules in COMMANDS.items() for each in rules if each.id == rule.id}


def selected_rules(
    command: str, settings: Settings, select: Iterable[str] | None = None, ignore: Iterable[str] | None = None
) -> tuple[tuple[Rule, ...], dict[str, list[Rule]]]:
    """Return the rules that `command` applies, and those to ignore by message. Raises InputError with all errors.

    `breaking` and `lint` have the same settings, so that each of them leaves out the rules of the other. An option
    must name rules of the command: `select` and `ignore` are the options --select and --ignore, None if not given.
    """
    own = COMMANDS[command]
    settable = {rule.id for name in ("breaking", "lint") for rule in COMMANDS[name]}
    errors: list[Diagnostic] = []

    def all_named(names: Iterable[str], allowed: set[str], place: Callable[[str], Location]) -> set[str]:
        found = {name: {rule.id for rule in named(name)} & allowed for name in names}
        errors.extend(
            Diagnostic(place(name), "C104", _unknown(name, command)) for name, ids in found.items() if not ids
        )
        return {each for ids in found.values() for each in ids}

    def chosen(key: str, names: Iterable[str] | None, given: Iterable[str] | None) -> set[str]:
        if given is not None:
            return all_named(given, {rule.id for rule in own}, lambda _: Location(f"--{key}", 0))
        return all_named(names or (), settable, partial(settings.place, key))

    selected = chosen("select", settings.select, select)
    ignored = {"*": chosen("ignore", settings.ignore, ignore)}
    for message, names in settings.per_message_ignores.items():
        ids = all_named(names, settable, partial(settings.place, "per-message-ignores", message))
        ignored[message] = ignored.get(message, set()) | ids
    if errors:
        raise InputError(errors)
    rules = tuple(rule for rule in own if rule.id in selected) or tuple(rule for rule in own if rule.is_default)
    of_command = {message: [rule for rule in own if rule.id in ids] for message, ids in ignored.items()}
    return rules, {message: found for message, found in of_command.items() if found}


def _unknown(name: str, command: str) -> str:
    rules = named(name)
    if rules:
        return f"'{name}' is a rule of {' and '.join(commands_of(rules[0]))} only"
    known = [*(rule.category.name for rule in COMMANDS[command]), *(rule.id for rule in COMMANDS[command])]
    return f"unknown rule '{name}'{suggestion(name, known)}"
