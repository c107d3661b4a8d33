"""Write the tables of rules in check.md, doctor.md and lint.md from the rules: `python docs/write_rules.py`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from msggen.check.compare.rules import RULES
from msggen.check.finding import Rule
from msggen.check.lint.rules import LINT
from msggen.doctor.rules import DOCTOR
from msggen.show.report.table import commands_of

DOCS = Path(__file__).resolve().parent
BEGIN = "<!-- docs/write_rules.py writes what follows, from the rules -->\n"
END = "<!-- the end of what it writes -->\n"


def _table(*rows: Sequence[str]) -> str:
    """Return a table. The first of `rows` is its head."""
    head, *lines = (f"| {' | '.join(row)} |\n" for row in rows)
    return "".join([head, "|---" * len(rows[0]), "|\n", *lines])


def _purpose(rule: Rule) -> str:
    """Return what a rule finds, with tags as code."""
    purpose = re.sub(r"'(@\w*)'", r"`\1`", rule.purpose)
    return purpose if rule.is_default else f"{purpose}; optional"


def _categories(rules: Iterable[Rule]) -> str:
    categories = dict.fromkeys(rule.category for rule in rules)
    return _table(("category", "effect"), *((each.name, each.value) for each in categories))


def _compared(rule: Rule) -> tuple[str, ...]:
    levels = {command: severity.value for command, severity in commands_of(rule).items()}
    return rule.id, rule.category.name, _purpose(rule), levels.get("check", ""), levels.get("breaking", "")


TABLES: Mapping[str, str] = MappingProxyType(
    {
        "check.md": _categories(RULES)
        + "\n"
        + _table(("rule", "category", "finds", "in `check`", "in `breaking`"), *map(_compared, RULES)),
        "doctor.md": _table(
            ("rule", "finds", "how to fix it"), *((f"`{rule.id}`", _purpose(rule), rule.fix) for rule in DOCTOR)
        ),
        "lint.md": _table(
            ("rule", "category", "reports"), *((rule.id, rule.category.name, _purpose(rule)) for rule in LINT)
        ),
    }
)
"""What is between BEGIN and END, by page."""


def page(name: str, current: str) -> str:
    """Return the page `name`: `current` with the tables of today's rules."""
    before, _, rest = current.partition(BEGIN)
    return f"{before}{BEGIN}\n{TABLES[name]}\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    for each in TABLES:
        (DOCS / each).write_text(page(each, (DOCS / each).read_text(encoding="utf-8")), encoding="utf-8")
