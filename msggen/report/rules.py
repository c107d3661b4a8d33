"""Texts about rules: the list of all rules, and an explanation of one with an example."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from msggen.compare.finding import Category, Report, Rule, Severity
from msggen.compare.rules import BREAKING, CHECKED
from msggen.report import render
from msggen.report.json import dump

_LEVELS = {Severity.ERROR: "an error", Severity.WARNING: "a warning"}


def list_rules(rules: Sequence[Rule]) -> str:
    """Return a line for each rule: ID, category and purpose."""
    names = max(len(rule.id) for rule in rules)
    categories = max(len(rule.category.name) for rule in rules)
    return "\n".join(f"{rule.id:{names}}  {rule.category.name:{categories}}  {rule.purpose}" for rule in rules)


def write_json(rules: Sequence[Rule]) -> str:
    """Return `rules` as JSON, each with the commands that apply it and the severity that it has there."""
    return dump(
        [
            {
                "id": rule.id,
                "category": rule.category.name,
                "purpose": rule.purpose,
                "effect": rule.category.value,
                "commands": {command: severity.value for command, severity in _severities(rule)},
            }
            for rule in rules
        ]
    )


def _severities(rule: Rule) -> list[tuple[str, Severity]]:
    """Return the commands that apply `rule`, with its severity."""
    applied = (("check", CHECKED), ("breaking", BREAKING))
    return [(command, each.severity) for command, rules in applied for each in rules if each.id == rule.id]


def explain_category(category: Category, rules: Sequence[Rule], *, width: int) -> str:
    """Return the meaning of a category, and the list of its `rules`."""
    return f"{_sentence(f'{category.name}: {category.value}.', width)}\n\n{list_rules(rules)}"


def explain_rule(rule: Rule, example: Report, *, width: int, colour: bool) -> str:
    """Return the purpose of `rule`, the commands that apply it, and its findings in `example`."""
    names: dict[Severity, list[str]] = {}
    for command, severity in _severities(rule):
        names.setdefault(severity, []).append(command)
    reported = ", ".join(f"by {' and '.join(commands)} as {_LEVELS[level]}" for level, commands in names.items())
    found = render(example, "full", width=width, colour=colour).rpartition("\n")[0].rstrip()
    return "\n".join(
        [
            f"{rule.id} ({rule.category.name}): {rule.purpose}.",
            "",
            _sentence(f"{rule.category.name}: {rule.category.value}. Reported {reported}.", width),
            "",
            "For example:",
            "",
            found,
        ]
    )


def _sentence(text: str, width: int) -> str:
    return fill(text, min(width, 100))
