"""The location of a node of the model or of an error."""

from bisect import bisect_right
from typing import NamedTuple


class Location(NamedTuple):
    """A place in a file. Lines and columns count from 1; line 0 means a whole file, a folder or an option."""

    path: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        path = self.path if self.path.isprintable() else repr(self.path)
        return f"{path}:{self.line}:{self.column}" if self.line else path


class Places:
    """The places of positions in a text, each found without counting its lines again."""

    def __init__(self, text: str, path: str) -> None:
        self._path = path
        self._starts = [0]
        for line in text.split("\n"):
            self._starts.append(self._starts[-1] + len(line) + 1)

    def at(self, position: int) -> Location:
        """Return the location of a position, which counts from 0."""
        line = bisect_right(self._starts, position)
        return Location(self._path, line, position - self._starts[line - 1] + 1)
