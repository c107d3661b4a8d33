"""A property: the rows of a fleet are those of the recordings, whatever happens to these and to its files."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

import pyarrow.parquet as pq
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from msggen import recordings
from msggen.exports.convert import convert
from msggen.exports.convert.names import FINDINGS
from msggen.exports.fleet import Keys, compact, files, update
from support.examples import examples
from support.fleet_logs import VEHICLES, flight
from support.fleet_recordings import parquet_in

CONTENTS = 3
PATHS = ("a.ulg", "b/a.ulg", "b/c.ulg")

Rows = Counter[tuple[str, str]]


@cache
def recording(number: int) -> tuple[bytes, Rows]:
    """Return a recording, and its rows by topic, as `msggen log convert` writes them for a single one."""
    folder = Path(mkdtemp())
    flight(number, VEHICLES[number], 0, is_new=number > 0).write(folder / "a.ulg")
    with recordings.open(folder / "a.ulg") as log:
        convert(log, str(folder / "tables"), format="parquet")
    found: Rows = Counter()
    for path in (folder / "tables").iterdir():
        found.update((path.stem.removesuffix("_1"), text) for text in texts(path))
    return (folder / "a.ulg").read_bytes(), found


def texts(path: Path) -> list[str]:
    """Return the rows of a file without the columns of keys, and without those that are NULL."""
    rows = pq.ParquetFile(path).read().to_pylist()
    return [repr(sorted((k, v) for k, v in row.items() if k not in Keys._fields and v is not None)) for row in rows]


UPDATE = ("update", "", 0)
ACTION = st.tuples(
    st.sampled_from(("write", "write", "move", "copy", "delete", "lose", "update", "update", "compact")),
    st.sampled_from(PATHS),
    st.integers(0, CONTENTS - 1),
)


@pytest.mark.slow
@settings(max_examples=examples(100, by_day=4))
@given(st.lists(ACTION, min_size=2, max_size=10))
@example([("write", "a.ulg", 0), UPDATE, ("write", "a.ulg", 1), UPDATE])
@example([("write", "a.ulg", 0), ("copy", "a.ulg", 1), UPDATE, ("delete", "a.ulg", 0), ("lose", "", 0)])
@example([("write", "a.ulg", 0), ("write", "b/a.ulg", 1), UPDATE, ("write", "a.ulg", 2)])
@example([("write", "a.ulg", 0), UPDATE, ("write", "b/a.ulg", 1), UPDATE, ("compact", "", 0)])
@example([("write", "a.ulg", 0), ("write", "b/a.ulg", 1), UPDATE, ("write", "a.ulg", 1), ("write", "b/a.ulg", 0)])
def test_a_fleet_has_the_rows_of_the_recordings(actions: Sequence[tuple[str, str, int]]) -> None:
    with TemporaryDirectory() as folder:
        logs, fleet = Path(folder, "logs"), Path(folder, "fleet")
        (logs / "b").mkdir(parents=True)
        owned: dict[Path, int] = {}  # what was last at a path when a run saw it: what is deleted stays in the fleet
        for action, name, number in [*actions, UPDATE]:
            path, other = logs / name, logs / PATHS[number]
            if action == "write":
                path.unlink(missing_ok=True)
                path.write_bytes(recording(number)[0])
            elif action in ("move", "copy") and path.is_file() and path != other:
                (shutil.move if action == "move" else shutil.copy)(path, other)
            elif action == "delete" and name:
                path.unlink(missing_ok=True)
            elif action == "lose" and len(there := list(logs.rglob("*.ulg"))) == len(owned):
                for each in [*parquet_in(fleet)][number :: CONTENTS * 2] if there else ():
                    (fleet / each).unlink()
            elif action == "compact" and owned:
                compact(str(fleet))
            elif action == "update" and any(logs.rglob("*.ulg")):
                kinds = {recording(each)[0]: each for each in range(CONTENTS)}
                owned |= {each: kinds[each.read_bytes()] for each in logs.rglob("*.ulg")}
                update(str(logs), str(fleet))
                check(fleet, {*owned.values()})


def check(fleet: Path, contents: set[int]) -> None:
    """Check that a fleet has the rows of some recordings once, in the files of its list and in those that are there."""
    expected: Rows = sum((recording(each)[1] for each in contents), Counter())
    found: Rows = Counter()
    for path in map(Path, files(str(fleet))):
        if path.parent.name != FINDINGS:  # which a single recording does not have
            found.update((path.parent.name, text) for text in texts(path))
    assert found == expected
    assert {str(fleet / place) for place in parquet_in(fleet)} == {*files(str(fleet))}
    assert len(pq.read_table(fleet / "_logs.parquet")) == len(contents)
