"""How far a mission has come, in a file, for a program that goes on with it later."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from logging import getLogger
from typing import Any, Final

from msggen.base.checked import UnexpectedError, field, fields, parsed, shortened, table, text, whole
from msggen.base.diagnostics import InputError
from msggen.base.disk.files import flush
from msggen.base.disk.reading import read_bytes
from msggen.base.disk.staging import written_aside
from msggen.flight.errors import FlightError

LOGGER = getLogger("msggen.flight")
_FORMAT: Final = "msggen mission state 1"
_MOST: Final = 1 << 31

_WRITER = ThreadPoolExecutor(1, "msggen mission")
"""Writes one state after the other, because a disk can take longer than the setpoints of a flight may wait. It ends its
work before the interpreter does."""


class StateFile:
    """A file with the index and the stored actions of a mission. There is none before the mission and after its end."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._is_told = False

    def load(self, checksum: str) -> tuple[int, Mapping[str, Any]] | None:
        """Return what was saved of the mission with a checksum, None if nothing was.

        Raises FlightError for a file that was not written by `save`: it is not overwritten.
        """
        return _WRITER.submit(self._load, checksum).result()

    def save(self, checksum: str, index: int | None, stored: Mapping[str, Any]) -> None:
        """Save how far a mission has come, or remove the file if the index is None. Does not wait for the disk."""
        content = {"format": _FORMAT, "mission": checksum, "index": index, "actions": stored}
        _WRITER.submit(self._write, None if index is None else json.dumps(content, indent=1).encode())

    def _load(self, checksum: str) -> tuple[int, Mapping[str, Any]] | None:
        try:
            content = parsed(read_bytes(self._path))
            _check_format(content)
            index = whole(field(content, "index"), 0, _MOST)
            stored = table(field(content, "actions"), fields)
            return (index, stored) if text(field(content, "mission")) == checksum else None
        except FileNotFoundError:
            return None
        except (OSError, UnexpectedError) as error:
            raise FlightError(
                f"{self._path} is not the state of a mission ({error}): remove it, or choose another file as `state`"
            ) from None

    def _write(self, content: bytes | None) -> None:
        path = os.path.abspath(self._path)
        try:
            if content is not None:
                with written_aside({path: content}) as move_into_place:
                    move_into_place()
                return
            with suppress(FileNotFoundError):
                os.unlink(path)
                flush([os.path.dirname(path)])
        except (OSError, InputError) as error:
            if not self._is_told:
                LOGGER.warning("the state of the mission is not saved, so that no other program goes on: %s", error)
            self._is_told = True


def _check_format(content: object) -> None:
    found = field(content, "format")
    if found != _FORMAT:
        raise UnexpectedError(f"its format is {shortened(found)}")
