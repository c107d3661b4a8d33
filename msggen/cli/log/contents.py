"""What MCAP files have beside their channels, by their summaries, for `msggen log info`."""

from __future__ import annotations

import os
import struct
from contextlib import suppress
from typing import NamedTuple

from msggen.base.diagnostics import counted
from msggen.base.recording_formats import MCAP


class Contents(NamedTuple):
    """The chunks and the further records of a recording in MCAP."""

    chunks: int
    compression: str
    """`zstd`, `lz4`, `none`, or several of them. "" without chunks."""
    attachments: int
    metadata: int

    def __str__(self) -> str:
        """Return one line for a user."""
        found = [
            f"{counted(self.chunks, 'chunk')} ({self.compression})" if self.chunks else "no chunks",
            *([counted(self.attachments, "attachment")] if self.attachments else []),
            *([counted(self.metadata, "metadata record")] if self.metadata else []),
        ]
        return ", ".join(found)


def contents_of(path: str) -> Contents | None:
    """Return the contents of an MCAP file, or of those in a folder. None if one has no summary that can be read."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    names = sorted(os.listdir(path)) if os.path.isdir(path) else []
    files = [os.path.join(path, name) for name in names if name.endswith(MCAP)] if names else [path]
    files = list(filter(os.path.isfile, files))
    chunks = attachments = metadata = 0
    kinds: set[str] = set()
    for each in files:
        with suppress(McapError, OSError, ValueError, struct.error), open(each, "rb") as file:
            summary = make_reader(file).get_summary()
            if summary is not None and summary.statistics is not None:
                kinds |= {chunk.compression or "none" for chunk in summary.chunk_indexes}
                chunks += summary.statistics.chunk_count
                attachments += summary.statistics.attachment_count
                metadata += summary.statistics.metadata_count
                continue
        return None
    return Contents(chunks, ", ".join(sorted(kinds)), attachments, metadata) if files else None
