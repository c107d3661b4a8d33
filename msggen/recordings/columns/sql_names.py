"""Names of columns that SQL takes without quotes: `q_0` for `q[0]`, `esc_0_esc_rpm` for `esc[0].esc_rpm`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

_OPENING = re.compile(r"[\[.]")
_OTHER = re.compile(r"[^0-9A-Za-z_]")
_WORDS = """
    add all alter analyse analyze and anti any array as asc asof asymmetric at authorization autoincrement between
    binary both by case cast check collate collation column commit concurrently constraint create cross current_catalog
    current_date current_role current_schema current_time current_timestamp current_user default deferrable delete desc
    describe distinct do drop else end escape except exists false fetch for foreign freeze from full glob grant group
    having if ilike in index initially inner insert intersect into is isnull join lambda lateral leading left like limit
    localtime localtimestamp natural not nothing notnull null offset on only or order outer overlaps pivot pivot_longer
    pivot_wider placing positional primary qualify raise references returning right select semi session_user set show
    similar some summarize symmetric table tablesample then to trailing transaction true union unique unpack unpivot
    update user using values variadic verbose when where window with
"""
_RESERVED = frozenset(_WORDS.split())
"""The words that DuckDB, SQLite or PostgreSQL do not take as the name of a column."""


def names_for_sql(names: Sequence[str]) -> list[str]:
    """Return names for columns of a table, in the same order. No two differ in case only, which SQL ignores.

    Names that SQL takes stay as they are. `_` is behind words that SQL has for itself, and behind names that others
    have already.
    """
    made = [_plain(name) for name in names]
    found: dict[int, str] = {}
    taken: set[str] = set()
    # those that stay come first, so that they do not depend on the others
    for index in sorted(range(len(names)), key=lambda index: made[index] != names[index]):
        name = made[index]
        while name.lower() in taken:
            name += "_"
        taken.add(name.lower())
        found[index] = name
    return [found[index] for index in range(len(names))]


def _plain(name: str) -> str:
    """Return a name that SQL takes."""
    made = _OTHER.sub("_", _OPENING.sub("_", name.replace("]", "")))
    if not made or made[0].isdigit():
        made = f"_{made}"
    return f"{made}_" if made.lower() in _RESERVED else made


def columns_for_sql(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return columns by such names."""
    return dict(zip(names_for_sql(list(columns)), columns.values(), strict=True))


def renamed_for_sql(table: Any) -> Any:
    """Return a table of Arrow with such names, and all of its metadata."""
    import pyarrow as pa

    names = names_for_sql(table.column_names)
    fields = [field.with_name(name) for field, name in zip(table.schema, names, strict=True)]
    return pa.Table.from_arrays(table.columns, schema=pa.schema(fields, table.schema.metadata))
