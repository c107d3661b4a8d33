"""The padding in messages of PX4's client, which has any value."""

from __future__ import annotations

import struct

from msggen.link.xrce import wire


def padding(message: bytes) -> set[int]:
    """Return the places of padding in a message with a header, in which PX4's client leaves stale memory."""
    found: set[int] = set()
    at = 4
    while at < len(message):
        kind, _, size = struct.unpack_from("<BBH", message, at)
        if kind == wire.CREATE:
            found |= {at + 4 + place for place in padding_of_create(message[at + 4 : at + 4 + size])}
        end = at + 4 + size
        at = end + -end % 4
        found |= {*range(end, at)}
    return found


def padding_of_create(payload: bytes) -> set[int]:
    """Return the places of padding in the payload of a CREATE."""
    kind, form, size = payload[4], payload[5], struct.unpack_from("<I", payload, 8)[0]
    places = [12 + place for place in padding_of_representation(kind, payload[12 : 12 + size])] if form == 3 else []
    return {6, 7, *places, *([12 + size] if kind == 1 and size % 2 else [])}


def padding_of_representation(kind: int, data: bytes) -> list[int]:
    """Return the places of padding in a binary representation."""
    at = 0
    places: list[int] = []
    for step in {2: "s..s", 8: "sss.s.s"}.get(kind, ""):  # strings, and flags between them
        if step == ".":
            at += 1
        else:
            places += range(at, at + -at % 4)
            at += -at % 4
            at += 4 + struct.unpack_from("<I", data, at)[0]
    return places + ([3] if kind in (5, 6) else []) + ([7] if kind == 6 else [])


def masked(message: bytes) -> bytes:
    """Return a message with zeros in its padding."""
    places = padding(message)
    return bytes(0 if place in places else byte for place, byte in enumerate(message))
