"""The table of the rules of all commands."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from msggen.analysis.rules.table import FLIGHT
from msggen.check.compare.rules import BREAKING, CHECKED
from msggen.check.compare.rules import RULES as OF_COMPARISONS
from msggen.check.finding import Rule, Severity
from msggen.check.lint.rules import LINT
from msggen.doctor.rules import DOCTOR, LIVE

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
