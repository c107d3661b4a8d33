"""Inputs of a catalog: a file, and the option that names a board."""

import os
from typing import NamedTuple

from msggen.base.location import Location
from msggen.sources.tree import Folder, Tree


class File(NamedTuple):
    """One input file.

    Messages to the user show its `path`, generated files its `name`. `tree` reads the file by its name; it is None for
    a file that the user named directly, which is opened by its path. `package` is the ROS package of the file, "" for
    the package of uORB's messages.
    """

    path: str
    name: str
    tree: Tree | None = None
    package: str = ""

    @property
    def stem(self) -> str:
        """The file name without its suffix: the name of the message or service that the file defines."""
        return os.path.splitext(os.path.basename(self.path))[0]


class BoardOption(NamedTuple):
    """A board that the user named at `place`, by its name or by the path of its file.

    It is `optional` for a side of a comparison that may have no boards.
    """

    text: str
    place: Location = Location("--board", 0)
    optional: bool = False

    @property
    def is_path(self) -> bool:
        """Whether the text is the path of a file, not the name of a board."""
        return "/" in self.text or os.sep in self.text or self.text.endswith(".px4board")


def read_file(file: File) -> bytes:
    """Return the contents of one file. Raises InputError."""
    if file.tree is not None:
        return file.tree.read(file.name)
    folder, name = os.path.split(file.path)
    return Folder(folder).read(name)
