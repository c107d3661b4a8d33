"""Texts about rules and marks: the list of all rules, and an explanation of a rule, a category or a mark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from msggen.check.finding import Category, Report, Rule, Severity
from msggen.show.report import render
from msggen.show.report.errors import explanation, how_to_fix
from msggen.show.report.json import dump
from msggen.show.report.table import commands_of

_LEVELS = {Severity.ERROR: "an error", Severity.WARNING: "a warning"}


class MarkText(NamedTuple):
    """The text about a mark of findings. `meaning` and `fix` are sentences."""

    meaning: str
    fix: str


_SILENT = MarkText(
    "marks a WIRE finding in a message whose samples keep their size, so that readers decode wrong values without an "
    "error. Sizes are compared after rounding up to a multiple of 4, because DDS rounds samples up. The mark names the "
    "readers that decode wrong values: old readers are built with the previous side and read samples of the current "
    "one; new readers are built with the current side and read samples of the previous one. A field that replaces "
    "padding is silent for new readers, because old samples contain these padding bytes, which are not always zero. A "
    "field that is replaced by padding is silent for old readers. A field that was only renamed is decoded correctly.",
    "Fix these findings first, as `msggen explain` describes for their rules. Do not run nodes built with different "
    "sides on one network.",
)

MARKS: Mapping[str, MarkText] = MappingProxyType(
    {
        **dict.fromkeys(("silent", "silent both ways", "silent for old readers", "silent for new readers"), _SILENT),
        "handled": MarkText(
            "marks a finding that a complete new version takes care of: MESSAGE_VERSION is higher by one, "
            "msg/px4_msgs_old/msg has the old definition with the same fields, and a header that all_translations.h "
            "includes translates between both. Between releases, a version can increase by more than one. Then each "
            "version in between must be archived, and headers must translate each step. A finding about a field or a "
            "constant is not handled while a line of the header about it has a TODO, or if the header does not "
            "mention the field, or sets it to a constant although the other version has its value. A changed unit, "
            "frame, range, enum or invalid value is handled if the header does not only copy the field. A header that "
            "names a field that its version does not have handles nothing. A handled finding does not fail the run.",
            "Nothing has to change. Applications built with the old version need PX4's translation node.",
        ),
        "warning": MarkText(
            "marks a finding that fails the run only with `--strict`: another rate limit or other options of a topic,"
            " a translation that omits a field or its value or still has a TODO, in `check` another unit, range, "
            "frame, enum or invalid value, and everything that `lint` finds.",
            "Read the finding and decide. `msggen explain` describes the fix for its rule.",
        ),
    }
)
"""The texts about marks, by the mark as findings have it, or its first word."""


def list_rules(rules: Sequence[Rule], *, colour: bool = False) -> str:
    """Return a line for each rule: ID, category, purpose, and whether it is optional."""
    bold, plain = ("\033[1m", "\033[0m") if colour else ("", "")
    names = max(len(rule.id) for rule in rules)
    categories = max(len(rule.category.name) for rule in rules)
    lines = [f"{bold}{rule.id:{names}}{plain}  {rule.category.name:{categories}}  {rule.purpose}" for rule in rules]
    return "\n".join(line if rule.is_default else f"{line} (optional)" for line, rule in zip(lines, rules, strict=True))


def write_json(rules: Sequence[Rule]) -> str:
    """Return `rules` as JSON, each with the commands that apply it and the severity that it has there."""
    return dump(
        [
            {
                "id": rule.id,
                "category": rule.category.name,
                "purpose": rule.purpose,
                "effect": rule.category.value,
                "fix": rule.fix,
                "commands": {command: severity.value for command, severity in commands_of(rule).items()},
                "optional": not rule.is_default,
            }
            for rule in rules
        ]
    )


def explain_category(category: Category, rules: Sequence[Rule], *, width: int) -> str:
    """Return the meaning of a category, and the list of its `rules`."""
    return f"{explanation(f'{category.name}: {category.value}.', width)}\n\n{list_rules(rules)}"


def explain_rule(rule: Rule, example: Report, *, width: int, colour: bool) -> str:
    """Return the purpose of `rule`, the commands that apply it, and its findings in `example`."""
    names: dict[Severity, list[str]] = {}
    for command, severity in commands_of(rule).items():
        names.setdefault(severity, []).append(command)
    reported = ", ".join(f"by {' and '.join(commands)} as {_LEVELS[level]}" for level, commands in names.items())
    reported += "" if rule.is_default else ", if it is selected"
    found = render(example, "full", width=width, colour=colour).rpartition("\n")[0].rstrip()
    return "\n".join(
        [
            f"{rule.id} ({rule.category.name}): {rule.purpose}.",
            "",
            explanation(f"{rule.category.name}: {rule.category.value}. Reported {reported}.", width),
            "",
            "For example:",
            "",
            found,
            "",
            how_to_fix(rule.fix, width),
        ]
    )


def explain_mark(mark: str, *, width: int) -> str:
    """Return the meaning of a mark in `MARKS`, and what to do about findings that have it."""
    text = MARKS[mark]
    return f"{explanation(f'{mark}: {text.meaning}', width)}\n\n{how_to_fix(text.fix, width)}"
