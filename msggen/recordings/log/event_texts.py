"""The texts of live events, by the metadata of the firmware that sends them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from msggen.recordings.decode.event_metadata import EventMetadataError, read_definitions
from msggen.recordings.log import opening
from msggen.recordings.log.events import Packed, event_of, metadata_in

if TYPE_CHECKING:
    from msggen.recordings.decode.event_metadata import Definition
    from msggen.recordings.source.facts import Event

_XZ = b"\xfd7zXZ\0"


class EventTexts:
    """The texts of a firmware's events. `metadata` is that of its build, `all_events.json.xz`, which a ULog has too."""

    def __init__(self, metadata: bytes) -> None:
        self._metadata = metadata
        self._known: dict[int, Definition | None] = {}

    def event(self, message: Any) -> Event:
        """Return the event of an Event message of any generated package. Raises EventMetadataError."""
        number = message.id
        if number not in self._known:
            self._known[number] = read_definitions(self._metadata, {number}).get(number)
        levels, arguments = message.log_levels, bytes(message.arguments)
        sample = Packed(message.timestamp * 1000, number, message.event_sequence, levels, arguments)
        return event_of(sample, self._known[number])


def event_texts(path: str) -> EventTexts:
    """Return the texts in a file: the metadata itself, or a ULog.

    Raises EventMetadataError, RecordingError, and OSError.
    """
    with open(path, "rb") as file:
        front = file.read(len(_XZ))
        metadata = front + file.read() if front == _XZ else None
    if metadata is None or not _is_metadata(metadata):
        with opening.open(path) as log:
            metadata = metadata_in(log.information)
        read_definitions(metadata, ())
    return EventTexts(metadata)


def _is_metadata(packed: bytes) -> bool:
    """Whether a file of xz has metadata, and no recording."""
    try:
        read_definitions(packed, ())
    except EventMetadataError:
        return False
    return True
