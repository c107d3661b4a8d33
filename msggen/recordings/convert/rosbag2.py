"""Recordings as folders of rosbag2: an MCAP file and `metadata.yaml`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from msggen.base.recording_formats import FORMATS, MCAP
from msggen.recordings.convert.recording import write_contents
from msggen.recordings.convert.selection import Converted
from msggen.recordings.files.paths import METADATA

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from msggen.recordings.convert.mcap import McapWriter
    from msggen.recordings.convert.selection import Selection
    from msggen.recordings.log.log import Log

_VERSION = 8
"""The version of the metadata, in which qualities of service are numbers, as `offered_qos_profiles` of our channels."""


def write_rosbag2(
    logs: Sequence[Log], folder: str, selection: Selection, progress: Callable[[float], None]
) -> Converted:
    """Write recordings to a folder. See `join`."""
    import yaml

    os.mkdir(folder)
    path = os.path.join(folder, f"{os.path.basename(folder)}_0{MCAP}")
    contents = write_contents(logs, path, selection, progress)
    metadata = os.path.join(folder, METADATA)
    with open(metadata, "x", encoding="utf-8") as file:
        yaml.safe_dump(_metadata(os.path.basename(path), contents.writer), file, sort_keys=False, allow_unicode=True)
    return Converted([path, metadata], contents.rows, contents.problems, contents.notes)


def _metadata(name: str, writer: McapWriter) -> dict[str, Any]:
    first = writer.first or 0
    extent = {
        "duration": {"nanoseconds": writer.last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(writer.counts.values()),
    }
    schemas = {schema.id: schema.name for schema in writer.schemas}
    topics = [
        {
            "topic_metadata": {
                "name": channel.topic,
                "type": schemas.get(channel.schema_id, ""),
                "serialization_format": channel.message_encoding,
                "offered_qos_profiles": channel.metadata.get("offered_qos_profiles", ""),
                "type_description_hash": channel.metadata.get("topic_type_hash", ""),
            },
            "message_count": writer.counts[channel.id],
        }
        for channel in writer.channels
    ]
    return {
        "rosbag2_bagfile_information": {
            "version": _VERSION,
            "storage_identifier": FORMATS["mcap"].storage,
            **extent,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [name],
            "files": [{"path": name, **extent}],
            "custom_data": None,
            "ros_distro": "unknown",
        }
    }
