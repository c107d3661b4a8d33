"""Recordings of a few samples, as `msggen record` writes them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msggen.exports.writer import Channel, Writer
from support.recordings import START


def write_recording(path: Path, samples: Iterable[tuple[str, float, Any]]) -> Path:
    """Write samples, each a topic, a time in s and a message, to an MCAP file. Return its path."""
    writer = Writer(str(path), "none")
    channels: dict[str, int] = {}
    for topic, time, message in samples:
        if topic not in channels:
            info = message.__msg__
            channels[topic] = writer.add_channel(Channel(topic, info.ros_type, info.definition, info.type_hash))
        when = START + round(time * 1e9)
        writer.write(channels[topic], when, when, message.encode())
    writer.close()
    return path
