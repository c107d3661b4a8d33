"""`msggen settings`: print the settings that are in force, and where they come from."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any, NamedTuple

from msggen.base.disk.urls import NO_URL
from msggen.cli.options import Run, add_flag, add_shared, new_command
from msggen.cli.source_options import settings_of
from msggen.cli.table import DIM, Column, print_table
from msggen.sources.finding import RELEASES
from msggen.sources.settings import SETTINGS, Setting, Settings, given_keys

_DEFAULT = "default"
_PATTERNS = {"package": "^[A-Za-z_][A-Za-z0-9_]*$", "ros-package": "^[a-z][a-z0-9_]*$"}
"""What a name must be, by the key of the setting."""


@new_command(
    "settings",
    "list the settings that are in force",
    "List the settings of [tool.msggen] in the nearest pyproject.toml, in the current folder or above "
    "it, with the line that each comes from, and what counts for those that are not set. Paths are those from the "
    "current folder. Options of a command take precedence.",
)
def add_to(parser: argparse.ArgumentParser) -> Run:
    """Add the arguments of the command."""
    form = parser.add_mutually_exclusive_group()
    add_shared(form, "--json")
    add_flag(form, "--schema", "print the JSON Schema of [tool.msggen], for editors")
    return _settings


def _settings(options: argparse.Namespace) -> None:
    if options.schema:
        from msggen.show.report.json import dump

        print(dump(_schema()))
        return
    rows = list(_rows(settings_of(options)))
    if options.json:
        from msggen.cli.table import objects_of
        from msggen.show.report.json import dump

        print(dump(objects_of(_COLUMNS, rows)))
    else:
        print_table(_COLUMNS, rows)


class _Row(NamedTuple):
    """A setting. Its value and the place that it comes from are None if it is not set."""

    key: str
    value: Any
    place: str | None
    default: str

    @property
    def in_force(self) -> str:
        """What counts, for people."""
        return self.default if self.place is None else _text(self.value)


_COLUMNS: tuple[Column[_Row], ...] = (
    Column("key", "setting", lambda row: row.key),
    Column("value", "", lambda row: row.value),
    Column("", "value", lambda row: row.in_force),
    Column("from", "", lambda row: row.place),
    Column("", "from", lambda row: row.place or _DEFAULT, style=lambda place: DIM if place == _DEFAULT else 0),
    Column("default", "", lambda row: row.default),
)


def _rows(settings: Settings) -> Iterator[_Row]:
    given = given_keys(settings)
    for setting in SETTINGS:
        if setting.key in given:
            place = settings.place(setting.key)
            value, where = getattr(settings, setting.field), f"{place.path}:{place.line}"
            yield _Row(setting.key, value, where, setting.default)
        else:
            yield _Row(setting.key, None, None, setting.default)


def _text(value: Any) -> str:
    """Return a value as text: `src`, `true`, `WIRE, HASH`, `Debug*: WIRE, HASH; /fmu/out/rpm: TOPIC`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "; ".join(f"{key}: {_text(rules)}" for key, rules in value.items())
    return value if isinstance(value, str) else ", ".join(value)


def _schema() -> dict[str, Any]:
    """Return the schema of the table `[tool.msggen]`."""
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "$id": "https://json.schemastore.org/partial-msggen.json",
        "title": "msggen",
        "description": "Settings of msggen, which generates Python types from the message definitions of PX4.",
        "type": "object",
        "additionalProperties": False,
        "properties": {setting.key: _schema_of(setting) for setting in SETTINGS},
    }


def _schema_of(setting: Setting) -> dict[str, Any]:
    about = {"description": f"{setting.about} Default: {setting.default}."}
    texts = {"anyOf": [_schema_of_text(setting), {"type": "array", "items": _schema_of_text(setting)}]}
    if setting.kind == "flag":
        return {**about, "type": "boolean"}
    if setting.kind == "list":
        return {**about, **texts}
    if setting.kind == "table":
        return {**about, "type": "object", "additionalProperties": texts}
    return {**about, **_schema_of_text(setting)}


def _schema_of_text(setting: Setting) -> dict[str, Any]:
    """Return the schema of a text, or of an item of a list."""
    if setting.key == "release":
        return {"type": "string", "enum": [*RELEASES]}
    pattern = NO_URL if setting.is_path else _PATTERNS.get(setting.key)
    return {"type": "string", "minLength": 1, **({"pattern": pattern} if pattern else {})}
