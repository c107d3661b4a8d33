"""The location of a node of the model or of an error."""

from typing import NamedTuple


class Location(NamedTuple):
    """A place in a file. Lines and columns count from 1; line 0 means a whole file, a folder or an option."""

    path: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        path = self.path if self.path.isprintable() else repr(self.path)
        return f"{path}:{self.line}:{self.column}" if self.line else path
