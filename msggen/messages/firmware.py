"""Which firmware a vehicle has: its endpoints and definitions, compared with those of the embedded releases."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Final, NamedTuple

from msggen.link.link import LinkError, Route, StaleError
from msggen.messages.names import stem_of, without_namespace

SMALL_STACK: Final = (
    "PX4's module zenoh has a stack that is too small for large messages to it, such as ArmingCheckReply of flight "
    "modes (PX4 28306): try on the ground whether the vehicle survives a registration, or use its uxrce_dds_client"
)
"""What everybody should know who lets modes fly over Zenoh."""
REQUEST = "/fmu/in/message_format_request"
RESPONSE = "/fmu/out/message_format_response"

PROTOCOL_VERSION = 1
"""LATEST_PROTOCOL_VERSION of MessageFormatRequest in all releases that have it."""

_REQUEST = struct.Struct("<4sQH50s")
_RESPONSE = struct.Struct("<4sQH50s?3xI")
_HEADER = b"\x00\x01\x00\x00"
_NAME_SIZE = 50


class Known(NamedTuple):
    """An endpoint of a release."""

    object_id: int
    message: str
    uorb_topic: str
    message_hash: int


class Firmware(NamedTuple):
    """The firmware of a vehicle, as far as it is known. Its text is "v1.17" or "v1.17; 2 messages differ: A, B"."""

    release: str
    """The nearest embedded release, "" if the vehicle has no endpoint of any."""
    differing: tuple[str, ...]
    """The messages whose definition, or version, is not that of the release."""
    missing: tuple[str, ...]
    """The endpoints of the release that the vehicle does not have, without namespace."""
    further: tuple[str, ...]
    """The endpoints of the vehicle that the release does not have, without namespace."""
    hashes: Mapping[str, int]
    """The `message_hash` of each message, by its ROS type, as the vehicle has answered so far."""
    is_complete: bool
    """Whether the vehicle was asked for all its definitions. Releases before v1.15 do not answer."""

    def __str__(self) -> str:
        if not self.release:
            return "unknown firmware"
        parts = [self.release]
        for names, one, more in (
            (self.differing, "message differs", "messages differ"),
            (self.further, "further topic", "further topics"),
        ):
            if names:
                parts.append(f"{len(names)} {one if len(names) == 1 else more}: {', '.join(names)}")
        return "; ".join(parts)

    def __repr__(self) -> str:
        return f"<Firmware {self}{'' if self.is_complete else ' (so far)'}>"  # without all the hashes


@lru_cache(maxsize=1)
def releases() -> Mapping[str, Mapping[str, Known]]:
    """Return the endpoints of each embedded release by their ROS names, the newest release first."""
    import json
    from importlib.resources import files

    table = json.loads(files("msggen.messages").joinpath("releases.json").read_text(encoding="utf-8"))
    return {release: {name: Known(*row) for name, row in rows.items()} for release, rows in table.items()}


def identify(
    routes: Iterable[Route], hashes: Mapping[str, int], namespace: str = "", *, is_complete: bool = True
) -> Firmware:
    """Return the firmware of a vehicle with these endpoints and hashes of messages by ROS type."""
    found = {without_namespace(route.name, namespace): route for route in routes}
    best = max(releases(), key=lambda release: _likeness(found, hashes, releases()[release]), default="")
    known = releases().get(best, {})
    if not best or not any(stem_of(name) in map(stem_of, known) for name in found):
        return Firmware("", (), (), tuple(sorted(found)), hashes, is_complete)
    stems = {stem_of(name): name for name in known}
    differing = set()
    for name, route in found.items():
        row = known.get(stems.get(stem_of(name), ""))
        if row is not None:
            own = hashes.get(route.ros_type, row.message_hash)
            if name not in known or own != row.message_hash or _message(route) != row.message:
                differing.add(_message(route))
    theirs = {stem_of(name) for name in found}
    missing = tuple(name for stem, name in stems.items() if stem not in theirs)
    further = tuple(name for name in found if stem_of(name) not in stems)
    return Firmware(best, tuple(sorted(differing)), missing, further, hashes, is_complete)


def _message(route: Route) -> str:
    return route.ros_type.rpartition("/")[2]


def _likeness(found: Mapping[str, Route], hashes: Mapping[str, int], known: Mapping[str, Known]) -> int:
    """Return how much a vehicle is like a release: by names, object ids and definitions, as far as they are known."""
    common = [(route, known[name]) for name, route in found.items() if name in known]
    score = 2 * len(common) - len(found) - len(known)
    for route, row in common:
        own = hashes.get(route.ros_type)
        score += (route.object_id == row.object_id) + (0 if own is None else 1 if own == row.message_hash else -1)
    return score


def answer_of(request: bytes, time: int, hash_of: Callable[[str], int | None]) -> bytes | None:
    """Return the answer of a vehicle to a MessageFormatRequest, or None to other bytes. Both are CDR with a header.

    `time` is its timestamp in us. `hash_of` gets the name of a uORB topic: PX4 looks up what follows the last `/`.
    """
    try:
        _, _, version, name = _REQUEST.unpack_from(request)
    except struct.error:
        return None
    _, slash, topic = name.partition(b"\0")[0].decode("ascii", "replace").rpartition("/")
    found = hash_of(topic) if slash and version == PROTOCOL_VERSION else None
    return _RESPONSE.pack(_HEADER, time, PROTOCOL_VERSION, name, found is not None, found or 0)


RETRY_NS = 300_000_000
TRIES = 4


class FormatCheck:
    """Asks a vehicle for the hashes of its definitions, one request at a time (docs/wire.md, section 18).

    PX4 keeps one request, so a second one before the answer would replace the first. All methods except `prefer` are
    called by the thread of the link.
    """

    def __init__(self, publish: Callable[[Route, bytes], None], told: Callable[[str], None]) -> None:
        self._publish, self._told = publish, told
        self._request: Route | None = None
        self._has_response = False
        self._waiting: deque[tuple[str, str]] = deque()  # ROS types, and the names to ask for
        self._first: dict[str, None] = {}
        self._known: set[str] = set()
        self._asked: tuple[str, str] | None = None
        self._tries = 0
        self.hashes: dict[str, int] = {}
        self.is_complete = False

    def add(self, routes: Iterable[Route], namespace: str) -> None:
        """Ask for the types of these routes too, beginning with those that are preferred."""
        names: dict[str, str] = {}
        for route in routes:
            name = without_namespace(route.name, namespace)
            if name == REQUEST:
                self._request = route
            self._has_response |= name == RESPONSE
            names.setdefault(route.ros_type, _request_name(name))
        preferred = [ros_type for ros_type in self._first if ros_type in names]
        for ros_type in dict.fromkeys((*preferred, *names)):
            if ros_type not in self._known:
                self._known.add(ros_type)
                self._waiting.append((ros_type, names[ros_type]))
                self.is_complete = False

    def recall(self, hashes: Mapping[str, int]) -> None:
        """Take hashes for those of the vehicle, without asking for them."""
        self.hashes |= hashes
        self._known |= hashes.keys()

    def prefer(self, ros_type: str) -> None:
        """Ask for this type first, or next if others were asked for already."""
        self._first[ros_type] = None
        for row in tuple(self._waiting):
            if row[0] == ros_type:
                self._waiting.remove(row)
                self._waiting.appendleft(row)

    def learn(self, hashes: Mapping[str, int], *, is_complete: bool) -> None:
        """Take hashes that the owner of the link knows. `is_complete` tells whether it has asked for all of them."""
        self.recall(hashes)
        self.is_complete = is_complete

    def receive(self, payload: bytes) -> bool:
        """Take an answer. Return whether it was the one that was expected."""
        try:
            _, _, _, name, is_found, message_hash = _RESPONSE.unpack_from(payload)
        except struct.error:
            return False
        asked = self._asked
        if asked is None or name.rstrip(b"\0").decode("ascii", "replace") != asked[1]:
            return False
        self._asked = None
        if is_found:
            self.hashes[asked[0]] = message_hash
            self._told(asked[0])
        return True

    def ask(self) -> None:
        """Send the next request, or the last one again if it has no answer."""
        if self._tries >= TRIES:
            self._asked = None
        if self._asked is None and self._waiting:
            self._asked, self._tries = self._waiting.popleft(), 0
        if self._asked is None or self._request is None or not self._has_response:
            self._asked, self.is_complete = None, True
            return
        self._tries += 1
        name = self._asked[1].encode("ascii", "replace")
        try:
            self._publish(self._request, _REQUEST.pack(_HEADER, 0, PROTOCOL_VERSION, name))
        except StaleError:  # a slow line is full just now: it is asked again
            return
        except LinkError:  # the vehicle disconnects
            self._asked, self.is_complete = None, True


def _request_name(ros_name: str) -> str:
    """Return the name that PX4 knows a topic by: the uORB topic after any path, without version."""
    for known in releases().values():
        if ros_name in known:
            front = ros_name.rpartition("/")[0]
            return f"{front}/{known[ros_name].uorb_topic}"[: _NAME_SIZE - 1]
    return stem_of(ros_name)[: _NAME_SIZE - 1]
