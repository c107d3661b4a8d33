"""The settings as a JSON Schema of draft 7, in the form that SchemaStore takes for a table in pyproject.toml."""

from __future__ import annotations

from typing import Any

from msggen.base.disk.urls import NO_URL
from msggen.sources.finding import RELEASES
from msggen.sources.settings import SETTINGS, Setting

_PATTERNS = {"package": "^[A-Za-z_][A-Za-z0-9_]*$", "ros-package": "^[a-z][a-z0-9_]*$"}
"""What a name must be, by the key of the setting."""


def schema_of_settings() -> dict[str, Any]:
    """Return the schema of the table `[tool.msggen]`."""
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "$id": "https://json.schemastore.org/partial-msggen.json",
        "title": "msggen",
        "description": "Settings of msggen, which generates Python types from the message definitions of PX4.",
        "type": "object",
        "additionalProperties": False,
        "properties": {setting.key: _property(setting) for setting in SETTINGS},
    }


def _property(setting: Setting) -> dict[str, Any]:
    about = {"description": f"{setting.about} Default: {setting.default}."}
    texts = {"anyOf": [_text(setting), {"type": "array", "items": _text(setting)}]}
    if setting.kind == "flag":
        return {**about, "type": "boolean"}
    if setting.kind == "list":
        return {**about, **texts}
    if setting.kind == "table":
        return {**about, "type": "object", "additionalProperties": texts}
    return {**about, **_text(setting)}


def _text(setting: Setting) -> dict[str, Any]:
    """Return the schema of a text, or of an item of a list."""
    if setting.key == "release":
        return {"type": "string", "enum": [*RELEASES]}
    pattern = NO_URL if setting.is_path else _PATTERNS.get(setting.key)
    return {"type": "string", "minLength": 1, **({"pattern": pattern} if pattern else {})}
