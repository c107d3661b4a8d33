"""Rules to text: the list of them, and each explained with an example."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from msggen.compare.finding import Category, Report, Rule, Severity
from msggen.compare.rules import BREAKING, CHECKED
from msggen.report import render

_SAYS = {Severity.ERROR: "fails", Severity.WARNING: "warns of it"}


def list_rules(rules: Sequence[Rule]) -> str:
    """Return a line for each rule: its ID, its category and its purpose."""
    names = max(len(rule.id) for rule in rules)
    categories = max(len(rule.category.name) for rule in rules)
    return "\n".join(f"{rule.id:{names}}  {rule.category.name:{categories}}  {rule.purpose}" for rule in rules)


def explain_category(category: Category, rules: Sequence[Rule], *, width: int) -> str:
    """Return what findings of a category mean, and the `rules` that it has."""
    return f"{_sentence(f'{category.name}: {category.value}.', width)}\n\n{list_rules(rules)}"


def explain_rule(rule: Rule, example: Report, *, width: int, colour: bool) -> str:
    """Return what `rule` is for, who asks it, and what it finds in its `example`."""
    names: dict[Severity, list[str]] = {}
    for command, rules in (("check", CHECKED), ("breaking", BREAKING)):
        for asked in rules:
            if asked.id == rule.id:
                names.setdefault(asked.severity, []).append(command)
    asked_by = ", and by ".join(f"{' and '.join(commands)}, which {_SAYS[say]}" for say, commands in names.items())
    found = render(example, "full", width=width, colour=colour).rpartition("\n")[0].rstrip()
    return "\n".join(
        [
            f"{rule.id} ({rule.category.name}): {rule.purpose}.",
            "",
            _sentence(f"{rule.category.name}: {rule.category.value}. Asked by {asked_by}.", width),
            "",
            "For example:",
            "",
            found,
        ]
    )


def _sentence(text: str, width: int) -> str:
    return fill(text, min(width, 100))
