"""Fleets as version 3 of the layout had them: a file for each recording and topic, and for each record."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from msggen import recordings
from msggen.recordings.convert import convert
from msggen.recordings.convert.names import FACT_TABLES, Place, file_names, place_of
from msggen.recordings.fleet import KEYS
from msggen.recordings.fleet.finding import digest_of, find_recordings, state_of
from msggen.recordings.fleet.layout import date_of, name_of, vehicle_of


def write_version3(logs: Path, fleet: Path, by: Sequence[str] = KEYS) -> Path:
    """Write a fleet of all recordings below a folder. Return its path."""
    (fleet / "_msggen" / "logs").mkdir(parents=True)
    (fleet / "_msggen" / "layout.json").write_text(json.dumps({"by": list(by), "version": 3}) + "\n")
    for found in find_recordings(str(logs)):
        try:
            _write_one(found.path, fleet, by)
        except recordings.RecordingError:
            shutil.rmtree(fleet / "made", ignore_errors=True)
    return fleet


def _write_one(path: str, fleet: Path, by: Sequence[str]) -> None:
    digest = digest_of(path)
    with recordings.open(path) as log:
        converted = convert(log, str(fleet / "made"), format="parquet")
        every = {"vehicle": vehicle_of(log), "date": date_of(log, path).day}
        topics = log.chosen(None)
        places = {stem: place_of(topic) for topic, stem in zip(topics, file_names(topics).values(), strict=True)}
        places |= {stem: Place(stem, "", 0) for stem in FACT_TABLES}
        name, files, size = name_of(path, digest), [], 0
        for made in converted.files:
            stem = Path(made).stem
            place = places[stem]
            keys = {key: every[key] for key in by} | {
                "log": name,
                "namespace": place.namespace or "none",
                "instance": str(place.instance),
            }
            folder = "/".join([place.name, *(f"{key}={value}" for key, value in keys.items())])
            (fleet / folder).mkdir(parents=True, exist_ok=True)
            files.append(f"{folder}/{stem}.parquet")
            size += os.path.getsize(made)
            os.replace(made, fleet / files[-1])
        shutil.rmtree(fleet / "made", ignore_errors=True)
        record = {
            "log": name,
            "digest": digest,
            "paths": {path: list(state_of(path))},
            "values": every,
            "date_from": date_of(log, path).origin,
            "files": files,
            "rows": converted.rows,
            "size": size,
            "problems": [f"{each.text} (at byte {each.offset})" for each in converted.problems],
            "notes": list(converted.notes),
            "firmware": log.firmware.release,
            "start": None if log.utc_offset is None else log.start + log.utc_offset,
            "utc_offset": log.utc_offset,
            "duration": log.duration,
        }
        (fleet / "_msggen" / "logs" / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n")
