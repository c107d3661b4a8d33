"""The folders and stores that an assistant may read, which are those that the command line names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from itertools import chain
from pathlib import Path

from msggen.base.diagnostics import few, input_error
from msggen.base.disk.names import path_hint
from msggen.base.disk.urls import is_address, shown_address
from msggen.exports.fleet.finding import Found, find_recordings
from msggen.recordings.files.paths import LOGS

_NO_PART = ("", ".", "..")
_CODED = "%\\?#"
"""What stands for other characters in an address, or ends its path."""


class Places:
    """Folders, recordings and addresses with all that is below them. Links that lead elsewhere are not followed."""

    def __init__(self, named: Sequence[str]) -> None:
        self._addresses = [each.rstrip("/") for each in named if is_address(each)]
        self._folders = [Path(os.path.realpath(each)) for each in named if not is_address(each)]

    def resolved(self, path: str) -> str:
        """Return the path of a recording that may be read. Raises InputError for any other, if it exists or not."""
        if is_address(path):
            if self._has_address(path):
                return path
        else:
            tried = [folder / path for folder in self._folders]
            inside = [each for each in map(_real, tried) if self._is_inside(each)]
            found = next(filter(os.path.exists, inside), None)
            if found is not None:
                return found
            if inside:
                hint = path_hint(inside[0], is_meant=os.path.exists)
                raise input_error(path, "R102", f"cannot be read: there is no such file{hint}", 0)
        shown = few([*map(str, self._folders), *map(shown_address, self._addresses)])
        text = f"only what is below {shown} is read" if shown else "nothing is read: name folders, `msggen mcp FOLDER`"
        link = "" if is_address(path) else next(filter(None, map(self._link_out_of, tried)), "")
        text += f": {link!r} is a link that leads elsewhere" if link else ""
        raise input_error(shown_address(path), "R102", text, 0)

    def recordings(self, pattern: str) -> Iterator[str]:
        """Yield the recordings that may be read, whose paths fit a pattern such as `*2026-11*`. Raises OSError."""
        for place in (*map(str, self._folders), *self._addresses):
            found = [Found(place)] if os.path.isfile(place) else find_recordings(place)
            for path, error, _ in found:
                is_readable = not error and (is_address(path) or self._is_inside(_real(path)))
                if is_readable and fnmatchcase(path, pattern):
                    yield path

    def _is_inside(self, path: str) -> bool:
        """Whether a path without links is below a folder that is named, with all that is read with it."""
        return self._is_below(path) and not self._leads_out(_with(path))

    def _leads_out(self, paths: Iterable[str]) -> str:
        """Return the first path that is a link to what may not be read, "" if there is none."""
        return next((each for each in paths if os.path.islink(each) and not self._is_below(_real(each))), "")

    def _link_out_of(self, path: Path) -> str:
        """Return the link because of which a path below a folder that is named may not be read, "" if there is none.

        Only the path of the link is told: not where it leads, nor whether something is there.
        """
        above = [str(each) for each in (*reversed(path.parents), path) if self._is_below(str(each))]
        if not above or not _real(path) or ".." in path.parts:
            return ""
        return self._leads_out(chain(above, _with(str(path))))

    def _is_below(self, path: str) -> bool:
        return any(Path(path).is_relative_to(folder) for folder in self._folders)

    def _has_address(self, path: str) -> bool:
        for place in self._addresses:
            rest = path.removeprefix(f"{place}/")
            is_plain = not any(part in _NO_PART for part in rest.split("/")) and not any(
                each in rest for each in _CODED
            )
            if path == place or (rest != path and is_plain):
                return True
        return False


def _with(path: str) -> Iterator[str]:
    """Yield what is read with a path: what is below and beside it."""
    below = (os.path.join(folder, name) for folder, *found in os.walk(path) for name in chain(*found))
    return chain(below, (path + ending for ending in LOGS))


def _real(path: str | Path) -> str:
    """Return a path without links, "" for one that no file can have or whose links may not be read."""
    try:
        return os.path.realpath(path)
    except (OSError, ValueError):
        return ""
