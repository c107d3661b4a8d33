"""`msggen rules` and `msggen explain`: list and explain rules, categories, marks and error codes."""

from __future__ import annotations

import argparse
import sys

from msggen.base.foreign import Styled
from msggen.cli.options import Commands, Run, add_output_format, add_value, new_command
from msggen.cli.printing import colour, width
from msggen.cli.values import non_empty


def add_to(commands: Commands) -> None:
    """Add both commands to the command line."""
    _add_rules(commands)
    _add_explain(commands)


@new_command(
    "rules",
    "list the rules of check, breaking and lint",
    "List the rules. Optional ones are only applied if they are selected.",
)
def _add_rules(parser: argparse.ArgumentParser) -> Run:
    add_output_format(parser, ("full", "json"))
    return _rules


@new_command(
    "explain",
    "explain a rule, a category, a mark or an error code, or list the rules of a command",
    "Explain a rule with its purpose, an example and a fix, or a category of rules, a mark of findings "
    "such as 'silent both ways', or an error code; or list the rules of check, breaking, lint, doctor or findings.",
)
def _add_explain(parser: argparse.ArgumentParser) -> Run:
    text = "rule, category, mark, error code or command, such as FIELD_MOVED, WIRE, handled, M301 or doctor"
    add_value(parser, "rule", "RULE", non_empty, text)
    return _explain


def _rules(options: argparse.Namespace) -> None:
    from msggen.show.report.rules import list_rules, write_json
    from msggen.show.report.table import RULES

    is_json = options.output_format == "json"
    print(Styled(write_json(RULES) if is_json else list_rules(RULES, colour=colour(sys.stdout))))


def _explain(options: argparse.Namespace) -> None:
    from msggen.show.report.explained import explained

    print(Styled(explained(options.rule, width=width(), colour=colour(sys.stdout))))
