"""A place in a file: what every node of the model and every error carries."""

from typing import NamedTuple


class Location(NamedTuple):
    """Lines and columns count from 1. Line 0 is no place in a file: an option, say."""

    path: str
    line: int = 1
    column: int = 1

    def __str__(self) -> str:
        path = self.path if self.path.isprintable() else repr(self.path)
        return f"{path}:{self.line}:{self.column}" if self.line else path
