"""Values as Python source."""

from __future__ import annotations

import math


def literal(value: object) -> str:
    """Return `value` as a Python literal, strings in double quotes."""
    if isinstance(value, float) and not math.isfinite(value):
        return f'float("{value}")'
    if isinstance(value, tuple):
        return f"({''.join(literal(item) + ', ' for item in value).strip()})"
    if isinstance(value, str):
        if value.isascii() and value.isprintable() and '"' not in value and "\\" not in value:
            return f'"{value}"'
        quoted = repr("'" + value)
        return (
            '"' + quoted[2:]
            if quoted.startswith('"')
            else '"' + quoted[3:-1].replace("\\'", "'").replace('"', '\\"') + '"'
        )
    return repr(value)
