"""Answers: JSON of a limited length."""

from __future__ import annotations

from itertools import islice
from typing import Any

from msggen.base.diagnostics import input_error
from msggen.show.report.json import dump

LONGEST = 200_000
"""The most characters of an answer: some 60,000 tokens."""
_MOST = 1000
"""The most elements of a list, and keys of an object."""
_TEXT = 1000
"""The most characters of a text."""


def answer(document: Any) -> str:
    """Return a document as JSON, with a note where something is left out. Raises InputError if it is too long."""
    text = str(dump(_limited(document), indent=None))
    if len(text) > LONGEST:
        told = f"it has {len(text):,} characters, up to {LONGEST:,} are sent: ask for less, such as some fields"
        raise input_error("the answer", "R102", told, 0)
    return text


def _limited(value: Any) -> Any:
    if isinstance(value, str):
        return value if len(value) <= _TEXT else f"{value[:_TEXT]}… and {len(value) - _TEXT} more characters"
    if isinstance(value, dict):
        made = {_limited(str(key)): _limited(item) for key, item in islice(value.items(), _MOST)}
        return made if len(value) <= _MOST else {**made, "…": f"and {len(value) - _MOST} more"}
    if isinstance(value, (list, tuple)):
        made_of = [_limited(item) for item in value[:_MOST]]
        return made_of if len(value) <= _MOST else [*made_of, f"… and {len(value) - _MOST} more"]
    return value
