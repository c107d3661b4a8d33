"""What the files of a fleet are called, and the columns that tell the recording of each row."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from datetime import date, datetime, timezone
from typing import TYPE_CHECKING, NamedTuple

from msggen.recordings.files.paths import stem_of
from msggen.recordings.log.origin import gps_offset_of

if TYPE_CHECKING:
    from msggen.exports.convert.names import Place
    from msggen.recordings.log.log import Log

STATE = "_msggen"
"""The folder of what is beside the data. Engines skip names that begin with an underscore."""
KEYS = ("vehicle", "date")
"""What rows can be sorted by, before all else."""
UNKNOWN = "unknown"
ORIGINS = ("gps", "name", "clock", UNKNOWN)
"""Where the day of a recording can come from."""
NONE = "none"
"""The namespace of topics without one."""
DIGITS = 8
"""How many digits of its digest the name of a recording has."""

_STRANGE = re.compile(r"[^A-Za-z0-9_.-]+")
_PLACE = re.compile(r"[A-Za-z0-9-][\w.-]*/\d{6,12}-[0-9a-f]{8}(?:-\d{1,6}){0,3}\.parquet", re.ASCII)
_STAGE = re.compile(rf"{STATE}/[0-9a-f]{{8}}\.stage")
_DATE = re.compile(r"(?<!\d)(20\d\d)([-_.]?)(\d\d)\2(\d\d)(?!\d)")
_LOGGER = "[logger] "
"""The front of PX4's line that names its log: `[logger] /fs/microsd/log/2026-01-12/10_23_26.ulg`."""
_LONGEST = 80
_YEAR_2001, _YEAR_2100 = 978_307_200 * 10**9, 4_102_444_800 * 10**9


class Keys(NamedTuple):
    """The columns in front of those of a topic: of which recording a row is. They are strings, and an int32."""

    vehicle: str
    date: str
    log: str
    namespace: str
    instance: int


def keys_of(place: Place, *, vehicle: str, date: str, log: str) -> Keys:
    """Return the keys of a topic in a recording."""
    return Keys(vehicle, date, log, place.namespace or NONE, place.instance)


def order_of(by: Sequence[str]) -> tuple[str, ...]:
    """Return the columns that rows are sorted by: those of KEYS that were chosen first, and the time comes last."""
    return tuple(dict.fromkeys((*by, *Keys._fields)))


def is_place(name: object) -> bool:
    """Whether this is the path of a file below the folder of a fleet: `<topic>/000012-9f3a5c01.parquet`.

    No such name leads out of the fleet, on any system. Other files are not of the fleet.
    """
    return isinstance(name, str) and _PLACE.fullmatch(name) is not None


def topic_of(place: str) -> str:
    """Return the folder of the topic that a file is in."""
    return place.partition("/")[0]


def stage_of(run: str) -> str:
    """Return the stage of a run: in a folder, where its files wait until they are part of the fleet."""
    return f"{STATE}/{run}.stage"


def is_stage(name: str) -> bool:
    """Whether this is the stage of a run."""
    return _STAGE.fullmatch(name) is not None


def run_of(token: str) -> str:
    """Return the run that a change and its files are named after: that of `000012-9f3a5c01` is `9f3a5c01`."""
    return token.split("-")[1]


def number_of(place: str) -> int:
    """Return the number of the change that a file was added by."""
    return int(place.partition("/")[2].partition("-")[0])


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


def date_of(log: Log, path: str) -> tuple[str, str]:
    """Return the day of a recording in UTC, and where it comes from, one of ORIGINS.

    It is that of GPS, of the name of the file or its folder, or of the clock of the recorder.

    A line of the vehicle's log has the name that the file had on the vehicle, in a folder with the date.
    """
    is_of_ulog = log.has_facts
    offset = log.utc_offset if is_of_ulog else gps_offset_of(log.topics, log.samples)
    if offset is not None:
        day = _day(log.start + offset) or _day(log.end + offset)  # a first sample can have the time 0
        if day:
            return day, "gps"
    lines = (text.text for text in log.facts.texts if text.text.startswith(_LOGGER))
    for name in (os.path.basename(path), os.path.basename(os.path.dirname(path)), *lines):
        day = day_in(name)
        if day:
            return day, "name"
    day = "" if is_of_ulog else _day(log.start)
    return (day, "clock") if day else (UNKNOWN, UNKNOWN)


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
