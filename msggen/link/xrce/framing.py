"""Frames of a serial line: docs/xrce.md, 9.

The begin byte occurs in a frame only at its start, so a receiver that lost bytes continues at the next one.
"""

from __future__ import annotations

from typing import Final

BEGIN: Final = b"\x7e"
AGENT: Final = 0
"""The address of the agent on a serial line."""
CLIENT: Final = 1
"""The address of PX4's client on a serial line."""
LONGEST: Final = 4096
"""The length of the longest message in a frame. PX4's client sends up to 508 bytes."""


def _table() -> tuple[int, ...]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)  # noqa: PLW2901
        table.append(value)
    return tuple(table)


_TABLE = _table()


def crc16(data: bytes) -> int:
    """Return the CRC-16 of a message: polynomial 0x8005 reflected, start 0, no final xor."""
    crc = 0
    table = _TABLE
    for byte in data:
        crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
    return crc


def pack_frame(message: bytes, source: int = AGENT, destination: int = CLIENT) -> bytes:
    """Return the frame of a message. Raises ValueError if it is longer than LONGEST."""
    size = len(message)
    if size > LONGEST:
        raise ValueError(f"message of {size} bytes: a frame holds up to {LONGEST}")
    content = bytes((source, destination)) + size.to_bytes(2, "little") + message + crc16(message).to_bytes(2, "little")
    return BEGIN + content.replace(b"\x7d", b"\x7d\x5d").replace(BEGIN, b"\x7d\x5e")


class Deframer:
    """The receiver of a serial line: bytes in, in chunks of any size, messages out.

    The length in a frame tells its end, so a message is returned as soon as its last byte is there. Bytes that are no
    frame are skipped up to the next begin byte.
    """

    def __init__(self, address: int = AGENT) -> None:
        self.address = address
        """The own address. Frames to another one are ignored."""
        self.frames = 0
        self.broken = 0
        """Frames with a wrong checksum or length, or that were cut."""
        self.skipped = 0
        """Bytes between frames."""
        self._kept = b""  # the beginning of a frame after its begin byte, still escaped
        self._inside = False

    def feed(self, data: bytes) -> list[bytes]:
        """Return the messages that these bytes complete."""
        parts = data.split(BEGIN)
        messages: list[bytes] = []
        self._add(parts[0], messages)
        for part in parts[1:]:
            if self._inside:
                self.broken += 1
            self._kept, self._inside = b"", True
            self._add(part, messages)
        return messages

    def _add(self, part: bytes, messages: list[bytes]) -> None:
        """Add bytes without a begin byte to the frame."""
        if not self._inside:
            self.skipped += len(part)
            return
        self._kept += part
        content, rest = _unescape(self._kept)
        if len(content) < 4:
            return
        size = content[2] | content[3] << 8
        end = size + 6
        if size > LONGEST:
            self._drop()
        elif len(content) >= end:
            message = content[4 : end - 2]
            if crc16(message) != content[end - 2] | content[end - 1] << 8:
                self._drop()
                return
            self._kept, self._inside = b"", False
            self.frames += 1
            self.skipped += len(content) - end + rest
            if content[1] == self.address:
                messages.append(message)

    def _drop(self) -> None:
        self.broken += 1
        self._kept, self._inside = b"", False


def _unescape(data: bytes) -> tuple[bytes, int]:
    """Return the content, and the number of bytes at the end that are half an escape."""
    half = (len(data) - len(data.rstrip(b"\x7d"))) & 1
    if half:
        data = data[:-1]
    return data.replace(b"\x7d\x5e", BEGIN).replace(b"\x7d\x5d", b"\x7d"), half
