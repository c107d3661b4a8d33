"""One input of a catalog: a file, or the option that names a board."""

import os
from typing import NamedTuple

from msggen.firmware.tree import Folder, Tree
from msggen.location import Location


class File(NamedTuple):
    """One input: `path` names it to the user, `name` cites it in what is generated.

    `tree` reads it by its name; a file that was named by itself has none, and is opened by its path. `package` is the
    ROS package that it belongs to, "" for that of uORB's messages.
    """

    path: str
    name: str
    tree: Tree | None = None
    package: str = ""

    @property
    def stem(self) -> str:
        """The name of what the file defines."""
        return os.path.splitext(os.path.basename(self.path))[0]


class BoardOption(NamedTuple):
    """A board that was asked for at `place`: its name, or the path of its file.

    It is `optional` for a side of a comparison that need not have boards.
    """

    text: str
    place: Location = Location("--board", 0)
    optional: bool = False

    @property
    def is_path(self) -> bool:
        """Whether it is a file, and not the name of a board."""
        return "/" in self.text or os.sep in self.text or self.text.endswith(".px4board")


def read_file(file: File) -> bytes:
    """Return the contents of one file. Raises InputError."""
    if file.tree is not None:
        return file.tree.read(file.name)
    folder, name = os.path.split(file.path)
    return Folder(folder).read(name)
