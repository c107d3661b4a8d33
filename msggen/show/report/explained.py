"""What `msggen explain` says about a rule, a category, a command with rules, a mark or an error code."""

from __future__ import annotations

from msggen.base.diagnostics import CODES, input_error, suggestion
from msggen.check.finding import Category
from msggen.show.report.errors import explain_code, nearest_code
from msggen.show.report.examples import example_of
from msggen.show.report.rules import MARKS, explain_category, explain_mark, explain_rule, list_rules
from msggen.show.report.table import COMMANDS, RULES, named

OF_COMMANDS = {command.removeprefix("log "): rules for command, rules in COMMANDS.items()}
"""The rules of each command: those of `log findings` as `findings`."""


def explained(word: str, *, width: int, colour: bool = False) -> str:
    """Return the text about a rule, a category, a mark or an error code, or the rules of a command, in any case.

    Raises InputError for other words.
    """
    name, mark = word.upper(), word.lower()
    rules = named(name)
    if name in CODES:
        return explain_code(name, width=width)
    if name in Category.__members__:
        return explain_category(Category[name], rules, width=width)
    if rules:
        return explain_rule(rules[0], example_of(rules[0]), width=width, colour=colour)
    if mark in OF_COMMANDS:
        return list_rules(OF_COMMANDS[mark], colour=colour)
    if mark in MARKS:
        return explain_mark(mark, width=width)
    if nearest := nearest_code(name):
        raise input_error("explain", "C104", f"unknown code '{word}', did you mean '{nearest}'?", 0)
    known = [*(rule.id for rule in RULES), *Category.__members__, *OF_COMMANDS, *MARKS, *CODES]
    hint = suggestion(word, known) or ": `msggen rules` lists them"
    raise input_error("explain", "C104", f"unknown rule '{word}'{hint}", 0)
