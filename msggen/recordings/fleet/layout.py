"""Where the files of a recording are in a fleet: by vehicle, by date, or both."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from datetime import date, datetime, timezone
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.convert.names import Place, place_of
from msggen.recordings.files.paths import stem_of
from msggen.recordings.log.origin import gps_offset_of

if TYPE_CHECKING:
    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

VERSION = 3
"""The version of the layout. A fleet has only files of one."""
KEYS = ("vehicle", "date")
"""What folders can be named after."""
UNKNOWN = "unknown"
ORIGINS = ("gps", "name", "clock", UNKNOWN)
"""Where the day of a recording can come from."""
NONE = "none"
"""The namespace of topics without one. All files of a data set must have the same keys."""
DIGITS = 8
"""How many digits of its digest the name of a recording has."""

_STRANGE = re.compile(r"[^A-Za-z0-9_.-]+")
_DATE = re.compile(r"(?<!\d)(20\d\d)([-_.]?)(\d\d)\2(\d\d)(?!\d)")
_LOGGER = "[logger] "
"""The front of PX4's line that names its log: `[logger] /fs/microsd/log/2026-01-12/10_23_26.ulg`."""
_LONGEST = 80
_YEAR_2001, _YEAR_2100 = 978_307_200 * 10**9, 4_102_444_800 * 10**9


class Dated(NamedTuple):
    """The day of a recording, in UTC, and where it comes from, one of ORIGINS."""

    day: str
    origin: str


def places_of(topics: Iterable[Topic], values: Mapping[str, str], log: str) -> dict[tuple[str, int], str]:
    """Return the path of the file of each topic of a recording, below the folder of the fleet, by name and instance.

    `values` are those of the keys, in order. Folders have the form `key=value` that Hive began and that DuckDB, Polars,
    Arrow, Dask and Spark read as columns. They depend on the topic alone. If the definition of a topic changes in a
    recording, it has several files in one folder.
    """
    found: dict[tuple[str, int], str] = {}
    counts: Counter[str] = Counter()
    for topic in topics:
        place = place_of(topic)
        folder = _folder_of(place, values, log)
        stem = f"{place.name}_{place.instance}" if place.instance else place.name
        counts[folder] += 1
        end = f"-{counts[folder]}.parquet" if counts[folder] > 1 else ".parquet"
        found[topic.name, topic.instance] = f"{folder}/{stem}{end}"
    return found


def place_of_facts(name: str, values: Mapping[str, str], log: str) -> str:
    """Return the path of a table of FACT_TABLES, as `places_of` does for topics."""
    return f"{_folder_of(Place(name, '', 0), values, log)}/{name}.parquet"


def _folder_of(place: Place, values: Mapping[str, str], log: str) -> str:
    keys = {**values, "log": log, "namespace": place.namespace or NONE, "instance": str(place.instance)}
    return "/".join((place.name, *(f"{key}={value}" for key, value in keys.items())))


def cleaned(text: str) -> str:
    """Return a text as the value of a key: without characters that file systems refuse or engines escape."""
    return _STRANGE.sub("_", text).strip("._")[:_LONGEST] or UNKNOWN


def name_of(path: str, digest: str) -> str:
    """Return the name of a recording: that of its file, and the first digits of its digest.

    So recordings with the same name in different folders stay apart.
    """
    return f"{cleaned(stem_of(path))}-{digest[:DIGITS]}"


def vehicle_of(log: Log) -> str:
    """Return the number of the vehicle's board, which a ULog has, and an MCAP file made of one: `px4-0006...`.

    The numbers of many boards have no other digits than 0 to 9: Polars and Spark would read them as numbers, without
    the zeros in front.
    """
    return f"px4-{cleaned(log.vehicle)}" if log.vehicle else UNKNOWN


def date_of(log: Log, path: str) -> Dated:
    """Return the day of a recording: by GPS, by the name of the file or its folder, or by the clock of the recorder.

    A line of the vehicle's log has the name that the file had on the vehicle, in a folder with the date.
    """
    is_of_ulog = log.has_facts
    offset = log.utc_offset if is_of_ulog else gps_offset_of(log.topics, log.samples)
    if offset is not None:
        day = _day(log.start + offset) or _day(log.end + offset)  # a first sample can have the time 0
        if day:
            return Dated(day, "gps")
    lines = (text.text for text in log.facts.texts if text.text.startswith(_LOGGER))
    for name in (os.path.basename(path), os.path.basename(os.path.dirname(path)), *lines):
        day = day_in(name)
        if day:
            return Dated(day, "name")
    day = "" if is_of_ulog else _day(log.start)
    return Dated(day, "clock") if day else Dated(UNKNOWN, UNKNOWN)


def day_in(name: str) -> str:
    """Return the date in a name such as `log_12_2026-11-22.ulg` or `20261122_1530.mcap`, "" if there is none."""
    for found in _DATE.finditer(name):
        try:
            return date(int(found[1]), int(found[3]), int(found[4])).isoformat()
        except ValueError:
            continue
    return ""


def is_utc(time: int) -> bool:
    """Whether a time in ns since 1970 can be that of a clock that was set."""
    return _YEAR_2001 < time < _YEAR_2100


def _day(time: int) -> str:
    """Return the day of a time in ns since 1970, "" if no clock that was set tells it."""
    if not is_utc(time):
        return ""
    return datetime.fromtimestamp(time // 10**9, timezone.utc).date().isoformat()
