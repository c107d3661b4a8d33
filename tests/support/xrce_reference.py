"""A slow and obvious decoder of DDS-XRCE messages, as docs/xrce.md lists the fields. It shares no code with msggen."""

from __future__ import annotations

from typing import Any, TypeAlias

NAMES = (
    *("CREATE_CLIENT", "CREATE", "GET_INFO", "DELETE", "STATUS_AGENT", "STATUS", "INFO", "WRITE_DATA"),
    *("READ_DATA", "DATA", "ACKNACK", "HEARTBEAT", "RESET", "FRAGMENT", "TIMESTAMP", "TIMESTAMP_REPLY"),
)

Fields: TypeAlias = dict[str, Any]


class Bad(Exception):  # noqa: N818
    """Malformed bytes."""


class Cursor:
    """A position in a payload."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, count: int) -> bytes:
        if self.at + count > len(self.data):
            raise Bad("too short")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, size: int, *, big: bool = False, signed: bool = False, align: bool = True) -> int:
        if align:
            self.align(size)
        return int.from_bytes(self.take(size), "big" if big else "little", signed=signed)

    def align(self, size: int) -> None:
        while self.at % size:
            self.at += 1

    def string(self) -> str:
        size = self.number(4)
        if size == 0:
            raise Bad("a string without its NUL")
        try:
            return self.take(size)[:-1].decode()
        except UnicodeDecodeError:
            raise Bad("not UTF-8") from None


def message(data: bytes) -> tuple[Fields, list[tuple[str, int, bytes]]]:
    """Return the header of a message, and name, flags and payload of its submessages."""
    cursor = Cursor(data)
    header = {"session": cursor.number(1), "stream": cursor.number(1), "sequence": cursor.number(2)}
    if header["session"] < 0x80:
        header["key"] = cursor.number(4, big=True, align=False)
    found = []
    while len(data) - cursor.at >= 4:
        kind, flags, size = cursor.number(1), cursor.number(1), cursor.number(2)
        payload = cursor.take(size)
        if flags % 2 == 0:
            raise Bad("big-endian")
        found.append((NAMES[kind] if kind < len(NAMES) else str(kind), flags, payload))
        cursor.align(4)
    return header, found


def payload(name: str, flags: int, data: bytes) -> Fields:  # noqa: C901, PLR0911, PLR0912 - a branch for each kind
    """Return the fields of a payload."""
    cursor = Cursor(data)
    if name == "CREATE_CLIENT":
        fields = _protocol(cursor)
        fields["key"] = cursor.number(4, big=True, align=False)
        fields["session"] = cursor.number(1)
        if cursor.number(1):
            for _ in range(2 * cursor.number(4)):
                cursor.string()
        fields["mtu"] = cursor.number(2)
        return fields
    if name == "STATUS_AGENT":
        fields = {"status": cursor.number(1)}
        cursor.take(1)
        return fields | _protocol(cursor, only_cookie=True)
    if name == "ACKNACK":
        return {"first": cursor.number(2), "missing": cursor.number(2, big=True), "stream": cursor.number(1)}
    if name == "HEARTBEAT":
        return {"first": cursor.number(2), "last": cursor.number(2), "stream": cursor.number(1)}
    if name == "TIMESTAMP":
        return {"time": _time(cursor)}
    if name == "TIMESTAMP_REPLY":
        return {"transmitted": _time(cursor), "received": _time(cursor), "originated": _time(cursor)}
    fields = {"request": cursor.take(2), "object": cursor.take(2)}
    if name == "GET_INFO":
        fields["mask"] = cursor.number(4)
    elif name == "STATUS":
        fields["status"], _ = cursor.number(1), cursor.number(1)
    elif name == "INFO":
        fields |= _info(cursor)
    elif name == "READ_DATA":
        fields["stream"] = cursor.number(1)
        if cursor.number(1):
            raise Bad("format")
    elif name in ("WRITE_DATA", "DATA"):
        if flags & 0b1110:
            raise Bad("format")
        fields["data"] = data[4:]
    elif name != "DELETE":
        raise Bad(name)
    return fields


def _protocol(cursor: Cursor, *, only_cookie: bool = False) -> Fields:
    if cursor.take(4) != b"XRCE":
        raise Bad("cookie")
    if only_cookie:
        return {}
    if cursor.take(4)[0] != 1:
        raise Bad("version")
    return {}


def _info(cursor: Cursor) -> Fields:
    _, known = cursor.number(1), cursor.number(1)
    if not cursor.number(1):
        raise Bad("no configuration")
    kind = cursor.number(1)
    cookie, _, _, _ = cursor.take(4), cursor.take(2), cursor.take(2), cursor.number(1)
    if not cursor.number(1):
        raise Bad("no activity")
    cursor.number(1)
    available = cursor.number(2, signed=True)
    return {"known": known == 1, "kind": kind, "cookie": cookie, "available": available}


def _time(cursor: Cursor) -> int:
    return cursor.number(4, signed=True) * 10**9 + cursor.number(4)


def entity(data: bytes) -> Fields:
    """Return the fields of the payload of a CREATE, as far as PX4's client creates such an entity."""
    cursor = Cursor(data)
    fields: Fields = {"request": cursor.take(2), "object": cursor.take(2)}
    kind, form = cursor.number(1), cursor.number(1)
    fields |= {"kind": kind, "format": form}
    if form != 3:
        fields["text"] = cursor.string()
        fields["domain" if kind == 1 else "parent"] = cursor.number(2, signed=True) if kind == 1 else cursor.take(2)
        return fields
    size = cursor.number(4)
    inner = Cursor(cursor.take(size))
    fields["parent"] = cursor.take(2)
    if kind == 2:
        fields["name"] = inner.string()
        inner.number(1)
        inner.number(1)
        fields["type"] = inner.string()
    elif kind in (5, 6):
        fields["topic"] = inner.take(2)
        inner.number(1)
        fields["flags"] = inner.number(2)
        fields["depth"] = inner.number(2) if inner.number(1) else None
    elif kind == 8:
        fields |= {"service": inner.string(), "request_type": inner.string(), "reply_type": inner.string()}
        inner.number(1)
        fields["request_topic"] = inner.string()
        inner.number(1)
        fields["reply_topic"] = inner.string()
    return fields
