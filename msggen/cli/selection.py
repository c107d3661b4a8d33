"""The options `--select` and `--ignore`, and a look at the settings of the same names."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, sorted_out
from msggen.cli.options import add_value
from msggen.cli.values import non_empty
from msggen.sources.settings import Settings

if TYPE_CHECKING:
    from msggen.check.finding import Report


def add_selection(parser: argparse.ArgumentParser) -> None:
    """Add the options that select rules."""
    choice = parser.add_argument_group("rules")
    text = "rules or categories to apply (default: all that are not optional)"
    add_value(choice, "--select", "RULE,...", _list, text)
    add_value(choice, "--ignore", "RULE,...", _list, "rules or categories to leave out")


def _list(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in non_empty(text).split(","))


def unmatched(report: Report, settings: Settings, *, strict: bool) -> tuple[Diagnostic, ...]:
    """Return a warning for each name in the settings that matches no message, service or topic.

    Raises InputError for them with `strict`.
    """
    key = "per-message-ignores"
    found = (
        Diagnostic(settings.place(key, name), "C105", f"'{name}' matches no message, service or topic{hint}")
        for name, hint in report.unmatched.items()
    )
    return sorted_out(found, strict=strict)
