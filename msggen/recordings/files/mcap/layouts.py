"""The layouts of the records of MCAP (https://mcap.dev/spec) that are both read and written here."""

from __future__ import annotations

import struct

from msggen.base.recording_formats import FORMATS

MAGIC = FORMATS["mcap"].front
RECORD = struct.Struct("<BQ")
"""The opcode and the length of a record."""
FRONT = RECORD.size
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""What is before the payload of a message: opcode, length, channel, sequence, log time, publish time."""
HEAD = MESSAGE_HEAD.size
INDEX_HEAD = struct.Struct("<BQHI")
"""What is before the entries of a message index: opcode, length, channel, size of the entries in bytes."""
INDEX_FRONT = INDEX_HEAD.size
INDEX_ENTRY = struct.Struct("<QQ")
"""An entry of a message index: log time, offset in the chunk."""
ENTRY = INDEX_ENTRY.size
CHUNK_HEAD = struct.Struct("<QQQI")
"""The front of a chunk: first and last log time, size and CRC-32 of its records without the compression."""
