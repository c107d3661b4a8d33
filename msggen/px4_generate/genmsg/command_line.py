"""Where messages are searched for."""

from collections.abc import Iterable


def includepath_to_dict(includepath: Iterable[str]) -> dict[str, list[str]]:
    """Return the folders of each package, from texts `PACKAGE:FOLDER`."""
    folders: dict[str, list[str]] = {}
    for text in includepath:
        package, _, folder = text.partition(":")
        if folder:
            folders.setdefault(package, []).append(folder)
    return folders
