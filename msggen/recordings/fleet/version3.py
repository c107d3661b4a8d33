"""Fleets of version 3 of the layout, which had a file for each recording and topic, in folders named after the keys.

    fleet/<topic>/vehicle=<id>/date=<day>/log=<name>/namespace=<name>/instance=<number>/<topic>.parquet

Their records were files in `_msggen/logs`. The rows get the present layout one topic after the other, each in one step.
If that is interrupted, the next run goes on.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

from msggen.recordings.fleet.changes import write_files
from msggen.recordings.fleet.layout import PLACE_OF_VERSION_3, Keys, topic_of
from msggen.recordings.fleet.ledger import Change
from msggen.recordings.fleet.records import Record, read_json, record_of
from msggen.recordings.fleet.runs import opened

if TYPE_CHECKING:
    from msggen.recordings.fleet.ledger import Ledger

_LOGS = "logs"
_FURTHER = {"files", "size"}
"""What records had more."""


class _Old(NamedTuple):
    """A record, and its files."""

    record: Record
    places: list[str]


def upgrade(ledger: Ledger) -> None:
    """Give a fleet of version 3 the present layout. Raises FleetError for a damaged file, and OSError."""
    every = list(_records(ledger))
    known = ledger.numbers()
    new = list(_new_records(ledger, [each for each in every if each.record.log not in known]))
    if new:
        ledger.commit(Change(records=new))
    numbers = ledger.numbers()
    topics: dict[str, dict[str, Keys]] = {}
    for record, places in every:
        for place in places:
            if record.log in numbers and ledger.folder.has(place):
                topics.setdefault(topic_of(place), {})[place] = _keys(record, place)
    for topic, files in sorted(topics.items()):
        _upgrade_topic(ledger, topic, files)
    ledger.finish()
    ledger.write_layout()


def remove_records(ledger: Ledger) -> None:
    """Remove the records of version 3, which are not needed any more."""
    if os.path.lexists(os.path.join(ledger.folder.state, _LOGS)):
        for record, _ in list(_records(ledger)):
            ledger.folder.delete(f"{_LOGS}/{record.log}.json")
        with suppress(OSError):  # somebody has files there
            os.rmdir(os.path.join(ledger.folder.state, _LOGS))


def _upgrade_topic(ledger: Ledger, topic: str, places: Mapping[str, Keys]) -> None:
    with opened(ledger.folder.open) as files:
        runs = [files.whole(place, keys) for place, keys in sorted(places.items())]
        added = write_files(ledger, [(topic, runs)])
    ledger.commit(Change(added, list(places)))


def _records(ledger: Ledger) -> Iterator[_Old]:
    """Yield the records, without those that are not sound: anybody can have written them."""
    for name in ledger.folder.names(_LOGS):
        found = read_json(ledger.folder.read(f"{_LOGS}/{name}")) if name.endswith(".json") else None
        record = _record(found or {})
        if found is not None and record is not None and name == f"{record.log}.json":
            yield _Old(record, found["files"])


def _record(found: dict[str, Any]) -> Record | None:
    record = record_of({"number": 0, **{name: value for name, value in found.items() if name not in _FURTHER}})
    files = found.get("files")
    if record is None or not isinstance(files, list):
        return None
    matches = [PLACE_OF_VERSION_3.fullmatch(place) if isinstance(place, str) else None for place in files]
    return record if all(match is not None and match[1] == record.log for match in matches) else None


def _new_records(ledger: Ledger, every: list[_Old]) -> Iterator[Record]:
    """Yield records with numbers. If a file is missing, only the rows in the others are known."""
    number = ledger.next_number()
    for record, places in every:
        there = [place for place in places if ledger.folder.has(place)]
        if len(there) == len(places):
            yield record._replace(number=number)
        elif there:
            yield record._replace(number=number, digest="", paths={})
        else:
            continue
        number += 1


def _keys(record: Record, place: str) -> Keys:
    found = PLACE_OF_VERSION_3.fullmatch(place)
    assert found is not None  # noqa: S101 - `_record` has looked at it
    return Keys(record.values["vehicle"], record.values["date"], record.log, found[2], int(found[3]))
