"""What the site adds to pages from the program: an entry for each error code, and tables of rules and of names."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType

from msggen.analysis.rules.table import FLIGHT
from msggen.base.diagnostics import CODES
from msggen.check.compare.rules import RULES
from msggen.check.finding import Rule
from msggen.check.lint.rules import LINT
from msggen.doctor.rules import DOCTOR
from msggen.generate.render import views
from msggen.generate.text.words import FILTERS
from msggen.show.report.errors import ErrorText, error_texts, paragraph
from msggen.show.report.table import commands_of

WIDTH = 120
MARK = re.compile(r"^<!-- the site has (\w+) here -->\n", re.MULTILINE)
"""A line of a page, with the name of what is added: a key of `ADDED`."""

_CODE = re.compile(r"(?<=\[)([A-Z]\d{3})(?=\]\(errors\.md\))(\]\(errors\.md)")

_OF_EXAMPLES = "\nIn the examples, `cat` shows the files to create. Other output of the last command is left out.\n"

GROUPS = {
    "M": "Definitions",
    "Y": "`dds_topics.yaml`",
    "S": "Sources and outputs",
    "B": "`msggen bump`",
    "C": "Settings and rules",
    "F": "Mission files",
    "T": "Templates",
    "L": "Running vehicles",
    "R": "Recordings",
}


def with_tables(text: str) -> str:
    """Return the text of a page with what the program adds, and with links to the entries of error codes."""
    added = MARK.sub(lambda mark: ADDED[mark[1]](), text)
    return _CODE.sub(lambda found: f"{found[1]}{found[2]}#{found[1].lower()}", added)


def _errors() -> str:
    """Return a table of all error codes, and an entry for each."""
    texts = error_texts()
    rows = ((f"[{code}](#{code.lower()})", CODES[code].value, text.title) for code, text in texts.items())
    parts = [_table(("code", "level", "meaning"), *rows), _OF_EXAMPLES]
    for letter, codes in groupby(texts, lambda code: code[0]):
        parts.append(f"\n## {GROUPS[letter]}\n")
        parts += [_entry(code, texts[code]) for code in codes]
    return "".join(parts)


def _entry(code: str, text: ErrorText) -> str:
    return "\n".join(
        [
            f"\n### {code}\n",
            f"**{text.title[0].upper()}{text.title[1:]}** ({CODES[code].value})\n",
            f"{paragraph(text.meaning, WIDTH)}\n",
            f"```console\n{text.example}```\n",
            f"{paragraph(f'How to fix it: {text.fix}', WIDTH)}\n",
        ]
    )


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


def _of_check() -> str:
    return f"{_categories(RULES)}\n" + _table(
        ("rule", "category", "finds", "in `check`", "in `breaking`"), *map(_compared, RULES)
    )


def _of_lint() -> str:
    return _table(("rule", "category", "reports"), *((rule.id, rule.category.name, _purpose(rule)) for rule in LINT))


def _of_doctor() -> str:
    return _table(("rule", "finds", "how to fix it"), *((f"`{rule.id}`", _purpose(rule), rule.fix) for rule in DOCTOR))


def _of_flights() -> str:
    return _table(
        ("rule", "finds", "limit", "what to do"),
        *((f"`{rule.id}`", _purpose(rule), rule.source, rule.fix) for rule in FLIGHT),
    )


VIEWS = {
    "catalog": views.CatalogView,
    "message": views.MessageView,
    "field": views.FieldView,
    "constant": views.ConstantView,
    "leaf": views.LeafView,
    "topic": views.TopicView,
    "endpoint": views.EndpointView,
    "service": views.ServiceView,
}


def _of_templates() -> str:
    """Return a table of the names of each view, and one of the filters, from their docstrings."""
    parts = [f"\n### {kind}\n\n{_table(('name', ''), *_names(view))}" for kind, view in VIEWS.items()]
    filters = ((f"`{name}`", str(inspect.getdoc(each)).partition("\n")[0]) for name, each in FILTERS.items())
    return "".join([*parts, "\n### filters\n\n", _table(("name", ""), *filters)])


def _names(view: type) -> Iterator[tuple[str, str]]:
    """Yield the names of a view for templates, and what they are, those of its base classes first."""
    said = _attributes()
    for base in reversed(view.__mro__):
        for name in dict.fromkeys((*vars(base).get("__annotations__", ()), *vars(base))):
            if not name.startswith("_") and base.__module__ == views.__name__:
                text = said.get((base.__name__, name)) or str(inspect.getattr_static(base, name).__doc__)
                yield f"`{name}`", text.replace("|", r"\|")


def _attributes() -> dict[tuple[str, str], str]:
    """Return the text below each attribute of the views that has a type, by class and name."""
    classes = (each for each in ast.parse(inspect.getsource(views)).body if isinstance(each, ast.ClassDef))
    return {
        (each.name, ast.unparse(line.target)): str(below.value.value)
        for each in classes
        for line, below in zip(each.body, each.body[1:], strict=False)
        if isinstance(line, ast.AnnAssign) and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    }


ADDED: Mapping[str, Callable[[], str]] = MappingProxyType(
    {
        "errors": _errors,
        "check_rules": _of_check,
        "lint_rules": _of_lint,
        "doctor_rules": _of_doctor,
        "flight_rules": _of_flights,
        "template_names": _of_templates,
    }
)
"""The functions that make what is added, by name."""
