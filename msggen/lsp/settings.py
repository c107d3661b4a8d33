"""The settings in pyproject.toml: what is wrong with them, and their names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from lsprotocol.types import CompletionItemKind as Icon

from msggen.base.diagnostics import Diagnostic, InputError
from msggen.lsp.completion import Proposal
from msggen.show.report.table import selected_rules
from msggen.sources.settings import SETTINGS, parse_settings

_HEADER = re.compile(r"\s*\[tool\.msggen\]\s*(#.*)?")
_KEY = re.compile(r"([\w-]*)")


def check_settings(data: bytes, path: str) -> list[Diagnostic]:
    """Return the errors in the settings of a file."""
    try:
        settings = parse_settings(data.decode(errors="replace"), path)
        if settings:
            for command in ("lint", "breaking"):
                selected_rules(command, settings)
    except InputError as error:
        return [*error.diagnostics]
    return []


def complete_settings(lines: Sequence[str], line: int, prefix: str) -> Iterator[Proposal]:
    """Yield the settings that the table around a line can have; `prefix` is the text before the cursor."""
    above = next((each for each in reversed(lines[: line - 1]) if each.lstrip().startswith("[")), "")
    found = _KEY.fullmatch(prefix)
    if _HEADER.fullmatch(above) and found:
        given = {each.partition("=")[0].strip() for each in lines}
        for setting in SETTINGS:
            if setting.key not in given:
                yield Proposal(f"{setting.key} = ", Icon.Property, 1, setting.about)


def about_setting(lines: Sequence[str], line: int) -> str:
    """Return the text about the setting on a line, "" if there is none."""
    key = lines[line - 1].partition("=")[0].strip() if line <= len(lines) else ""
    known = {setting.key: setting for setting in SETTINGS}
    inside = any(_HEADER.fullmatch(each) for each in lines[: line - 1])
    if key not in known or not inside:
        return ""
    return f"**{key}**: {known[key].about}\n\ndefault: {known[key].default}"
