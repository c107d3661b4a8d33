"""Units that differ among fields that are parts of one vector."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from msggen.finding import Change
from msggen.lint.definition import Definition
from msggen.lint.joined import joined
from msggen.unit import normalized_unit


def find_inconsistent(definition: Definition) -> Iterator[Change]:
    """Yield the fields without the unit that most of the fields joined to them have, in a tag or in a sentence."""
    units = {
        field.name: field.comment.tag("unit")
        for field in definition.inferred.fields
        if field.comment.origin("unit") in ("tag", "prose")
    }
    for fields in joined(definition.message):
        counts = Counter(normalized_unit(units[field.name]) for field in fields if field.name in units)
        if not counts:
            continue
        usual = counts.most_common(1)[0][0]
        model = next(field for field in fields if normalized_unit(units.get(field.name, "")) == usual)
        for field in fields:
            own = units.get(field.name, "")
            if normalized_unit(own) != usual:
                has = f"is in [{own}]" if own else "has no unit"
                text = f"'{field.name}' {has}, but '{model.name}' is in [{units[model.name]}]"
                yield definition.change(field, text, f"[{field.comment.unit}" if field.comment.unit else "")
