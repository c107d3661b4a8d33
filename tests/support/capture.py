"""A capture of DDS traffic that Wireshark can read: for each writer its discovery, then its samples.

The format is pcap with raw IPv4, UDP and RTPS 2.2 (OMG DDSI-RTPS 2.2, sections 8.3 and 9.4), with one DATA submessage
in a packet.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

PREFIX = bytes(range(1, 13))
"""The prefix of the only participant's GUID."""

DISCOVERY = bytes([0, 0, 3, 0xC2])
"""The built-in writer that announces writers."""

ENDPOINT_GUID, TOPIC_NAME, TYPE_NAME, SENTINEL = 0x5A, 0x05, 0x07, 0x01


def capture(samples: Iterable[tuple[str, str, bytes]]) -> bytes:
    """Return a capture of `samples`, each a DDS topic, a DDS type, and the sample with its header."""
    packets: list[bytes] = []
    writers: dict[str, bytes] = {}
    for topic, type_name, sample in samples:
        if topic not in writers:
            writers[topic] = (len(writers) + 1).to_bytes(3, "big") + b"\3"
            packets.append(_packet(DISCOVERY, _announcement(writers[topic], topic, type_name)))
        packets.append(_packet(writers[topic], sample + bytes(-len(sample) % 4)))
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101)
    return head + b"".join(struct.pack("<IIII", 0, 0, len(data), len(data)) + data for data in packets)


def _announcement(writer: bytes, topic: str, type_name: str) -> bytes:
    parameters = [(ENDPOINT_GUID, PREFIX + writer), (TOPIC_NAME, _text(topic)), (TYPE_NAME, _text(type_name))]
    found = b"".join(struct.pack("<HH", kind, len(data)) + data for kind, data in parameters)
    return b"\0\3\0\0" + found + struct.pack("<HH", SENTINEL, 0)


def _text(text: str) -> bytes:
    data = text.encode() + b"\0"
    return struct.pack("<I", len(data)) + data + bytes(-len(data) % 4)


def _packet(writer: bytes, payload: bytes) -> bytes:
    data = struct.pack("<HH4s4siI", 0, 16, bytes(4), writer, 0, 1) + payload
    rtps = b"RTPS\2\2\1\x0f" + PREFIX + struct.pack("<BBH", 0x15, 0x05, len(data)) + data
    udp = struct.pack(">HHHH", 7410, 7411, 8 + len(rtps), 0) + rtps
    here = bytes([127, 0, 0, 1])
    return struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, here, here) + udp
