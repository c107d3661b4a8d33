"""ULogs with events of PX4, and metadata of our own."""

from __future__ import annotations

import json
import lzma
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from support.ulog import UlogWriter

START = 2_000_000
"""The start of the log in us."""
EVENTS: Mapping[str, Mapping[str, Any]] = {
    "1": {"name": "armed", "message": "Armed by {1}", "arguments": [{"name": "reason", "type": "reason_t"}]},
    "2": {
        "name": "climb",
        "message": "Climb to {1:.1m_v} at {2}%, not {3}",
        "description": '<profile name="dev">See <param>MIS_ALT</param> in '
        '<a href="https://a.b">the \\<list\\></a>.</profile>'
        '<profile name="normal">Call us.</profile><b>bold</b> {2:.2m/s}',
        "arguments": [{"name": "altitude", "type": "float"}, {"name": "throttle", "type": "uint8_t"}],
    },
    "3": {"name": "flags", "message": "Set {1} \\{1}", "arguments": [{"name": "set", "type": "common::set_t"}]},
    "4": {
        "name": "all",
        "message": "{1} {2} {3} {4} {5} {6}",
        "arguments": [
            {"name": f"a{index}", "type": type_}
            for index, type_ in enumerate(("int8_t", "uint16_t", "int16_t", "uint32_t", "int32_t", "uint64_t"))
        ],
    },
    "5": {"name": "plain", "message": " Landed < 3 {x} <a>https://c.d</a>\n"},
    "7": {
        "name": "long",
        "message": "{1}",
        "arguments": [{"name": f"b{index}", "type": "int64_t"} for index in range(4)],
    },
}
METADATA: Mapping[str, Any] = {
    "version": 1,
    "components": {
        "0": {
            "namespace": "common",
            "event_groups": {"default": {}, "calibration": {"events": {"9": {"name": "done", "message": "Done"}}}},
            "enums": {
                "set_t": {
                    "type": "uint16_t",
                    "is_bitfield": True,
                    "separator": "/",
                    "entries": {"1": {"name": "a", "description": "one"}, "4": {"name": "b", "description": "four"}},
                }
            },
        },
        "1": {
            "namespace": "px4",
            "event_groups": {"default": {"events": EVENTS}},
            "enums": {
                "reason_t": {
                    "type": "int8_t",
                    "entries": {
                        "2": {"name": "stick", "description": "stick gesture"},
                        "3": {"name": "generic", "description": ""},
                        "4": {"name": "remote"},
                    },
                }
            },
        },
    },
}


def packed(metadata: object = METADATA) -> bytes:
    """Return metadata as a firmware has it."""
    return lzma.compress(json.dumps(metadata).encode())


class EventLog(UlogWriter):
    """A ULog with a topic `event`."""

    def __init__(self, metadata: bytes | None) -> None:
        super().__init__(start=START)
        self.information("char[3] sys_name", b"PX4")
        if metadata is not None:
            self.information("char[64] metadata_events_sha256", b"0" * 64)
            for begin in range(0, len(metadata) or 1, 100):
                part = metadata[begin : begin + 100]
                self.part(f"uint8_t[{len(part)}] metadata_events", part, continues=begin > 0)
        self.format(
            "event", "uint64_t timestamp;uint32_t id;uint16_t event_sequence;uint8_t[25] arguments;uint8_t log_levels"
        )
        self.subscribe(0, "event")
        self._count = 0

    def event(self, number: int, time: int, arguments: bytes = b"", *, levels: int = 0x66, component: int = 1) -> None:
        """Add an event `time` us after the start. The level of the log is the high half of `levels`."""
        front = struct.pack("<QIH", START + time, component << 24 | number, self._count)
        self.sample(0, front + arguments.ljust(25, b"\0") + bytes([levels]))
        self._count += 1


def write_events(path: Path, metadata: bytes | None = None) -> str:
    """Write a log with an event of each kind, with METADATA by default."""
    log = EventLog(packed() if metadata is None else metadata)
    log.event(1, 0, b"\x02")
    log.text(6, START + 3, "Armed by stick gesture\t")
    log.text(4, START + 5, "[commander] low battery")
    log.event(1, 10, b"\xff", levels=0x35)
    log.event(2, 20, struct.pack("<fB", 2.25, 80), levels=0x45)
    log.event(3, 30, struct.pack("<H", 5))
    log.event(3, 40, struct.pack("<H", 9))
    log.event(4, 50, struct.pack("<bHhIiQ", -1, 2, -3, 4, -5, 6))
    log.event(5, 60)
    log.event(5, 70, levels=0x88)
    log.event(9, 80, component=0)
    log.event(0xABC, 90)
    return log.write(path)
