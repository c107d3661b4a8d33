"""Completions of topics and fields from a recording."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msggen.recordings import Topic


def recorded_topics(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the names of the topics in the recording of the options: of uORB, or those in the file after a `/`."""
    from msggen import recordings

    with recordings.open(options.file) as log:
        for topic in log.topics:
            yield topic.name if prefix.startswith("/") else _numbered(topic)


def recorded_fields(_: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the columns of the topics in the options, or of all."""
    from msggen import recordings
    from msggen.recordings.columns.arrays import names_of

    with recordings.open(options.file) as log:
        chosen = [options.topic] if getattr(options, "topic", None) else getattr(options, "topics", None)
        for topic in log.chosen(chosen or None):
            yield from names_of(log.dtype(topic))


def recorded_paths(prefix: str, options: argparse.Namespace) -> Iterator[str]:
    """Yield the paths of the columns of all topics: `vehicle_status.nav_state`."""
    from msggen import recordings
    from msggen.recordings.columns.arrays import names_of

    with recordings.open(options.file) as log:
        for topic in log.chosen(None):
            name = topic.name if prefix.startswith("/") else _numbered(topic)
            yield from [f"{name}.{column}" for column in names_of(log.dtype(topic))]


def _numbered(topic: Topic) -> str:
    """Return the name of a topic in uORB, with its instance: `sensor_gps[1]`."""
    return f"{topic.uorb}[{topic.instance}]" if topic.instance else topic.uorb
