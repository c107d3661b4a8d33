"""`msggen rules` and `msggen explain`: what `check` and `breaking` look for."""

from __future__ import annotations

import argparse

from msggen.cli.common import DONE, Commands, add_command, colour, given, width
from msggen.diagnostics import fault, suggestion


def add_to(commands: Commands) -> None:
    """Add both commands to the command line."""
    add_command(
        commands,
        "rules",
        _rules,
        help="list the rules of check and breaking",
        description="List the rules: check asks WIRE, HASH, SOURCE and DRIFT, breaking all but DRIFT.",
    )
    explain = add_command(
        commands,
        "explain",
        _explain,
        help="explain a rule with an example",
        description="Explain a rule: what it is for, and what it finds in an example.",
    )
    explain.add_argument("rule", metavar="RULE", type=given, help="as `msggen rules` lists it")


def _rules(_: argparse.Namespace) -> int:
    from msggen.compare.rules import RULES
    from msggen.report.rules import list_rules

    print(list_rules(RULES))
    return DONE


def _explain(options: argparse.Namespace) -> int:
    from msggen.check import example_of
    from msggen.compare.rules import RULES
    from msggen.report.rules import explain_rule

    rule = next((rule for rule in RULES if rule.id == options.rule.upper()), None)
    if rule is None:
        hint = suggestion(options.rule, [rule.id for rule in RULES]) or ": `msggen rules` lists them"
        raise fault("explain", "C104", f"unknown rule '{options.rule}'{hint}", 0)
    print(explain_rule(rule, example_of(rule), width=width(), colour=colour()))
    return DONE
