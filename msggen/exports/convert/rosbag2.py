"""Recordings as folders of rosbag2: a file, MCAP or a database, and `metadata.yaml`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import counted
from msggen.base.recording_formats import FORMATS, STORAGES
from msggen.exports.convert.db3 import DISTRO, Db3Writer, add_metadata_text
from msggen.exports.convert.mcap import McapWriter
from msggen.exports.convert.recording import Writer, write_contents
from msggen.exports.convert.selection import Converted
from msggen.recordings.files.paths import METADATA

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from msggen.exports.convert.selection import Selection
    from msggen.recordings.log.log import Log

_VERSION = 8
"""The version of the metadata, in which qualities of service are numbers, as `offered_qos_profiles` of our channels."""


_WRITERS: Mapping[str, tuple[str, type[Writer]]] = {
    FORMATS["mcap"].storage: (FORMATS["mcap"].suffix, McapWriter),
    FORMATS["db3"].storage: (FORMATS["db3"].suffix, Db3Writer),
}
"""The suffix and the writer of the file of each storage."""


def write_rosbag2(
    logs: Sequence[Log],
    folder: str,
    selection: Selection,
    progress: Callable[[float], None],
    storage: str = STORAGES[0],
) -> Converted:
    """Write recordings to a folder. See `join`."""
    import yaml

    os.mkdir(folder)
    suffix, make = _WRITERS[storage]
    path = os.path.join(folder, f"{os.path.basename(folder)}_0{suffix}")
    contents = write_contents(logs, path, selection, progress, make)
    writer, notes = contents.writer, list(contents.notes)
    information = _metadata(os.path.basename(path), writer, storage)
    document = {"rosbag2_bagfile_information": information}
    metadata = os.path.join(folder, METADATA)
    with open(metadata, "x", encoding="utf-8") as file:
        yaml.safe_dump(document, file, sort_keys=False, allow_unicode=True)
    if isinstance(writer, Db3Writer):
        # in the table, rosbag2 has the content alone
        add_metadata_text(path, _VERSION, yaml.safe_dump(information, sort_keys=False, allow_unicode=True))
        if writer.left_out:
            what = "attachments, metadata and definitions in other formats"
            notes.append(f"{counted(writer.left_out, 'record')} not written: a database has no place for {what}")
    return Converted([path, metadata], contents.rows, contents.problems, notes)


def _metadata(name: str, writer: Writer, storage: str) -> dict[str, Any]:
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
        "version": _VERSION,
        "storage_identifier": storage,
        **extent,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [name],
        "files": [{"path": name, **extent}],
        "custom_data": None,
        "ros_distro": DISTRO,
    }
