"""The table of a fleet that has what the flights show."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from msggen.analysis.document import document_of, examined
from msggen.exports.convert.facts import timed_table
from msggen.exports.convert.names import FINDINGS, Place
from msggen.exports.fleet.layout import keys_of
from msggen.exports.fleet.parts import Run

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log


LARGEST = 1 << 30
"""The bytes of a recording from which on a fleet has no findings: rules read their topics at once."""


def findings_run(log: Log, values: Mapping[str, str], name: str) -> list[tuple[str, Run]]:
    """Return the findings in a recording as rows of a fleet, none without findings. `values` are those of KEYS."""
    import pyarrow as pa

    made = document_of(*examined(log))["findings"] if log.size < LARGEST else []
    found = sorted(made, key=lambda each: each["time"] or 0.0)
    if not found:
        return []
    texts = {key: pa.array([each[key] for each in found], pa.string()) for key in ("rule", "level", "text")}
    times = {key: pa.array([each[key] for each in found], pa.float64()) for key in ("time", "end")}
    evidence = pa.array([json.dumps(each["values"]) for each in found], pa.string())
    begins = [log.start + round((each["time"] or 0.0) * 1e9) for each in found]
    table = timed_table(log, begins, **texts, **times, values=evidence)
    return [(FINDINGS, Run(keys_of(Place(FINDINGS, "", 0), values, name), table.schema, partial(iter, [table])))]
