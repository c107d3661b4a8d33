"""Installed ROS packages: where they are, and the sources `installed` and `installed:PACKAGE`, which name one.

Only definitions are read. Nothing of an installed package is executed or imported.
"""

import os
import re
from collections.abc import Iterator
from typing import NamedTuple

from msggen.base.diagnostics import Diagnostic, few, input_error, suggestion
from msggen.base.location import Location

INSTALLED = "installed"
"""The source that is the installed px4_msgs."""

PREFIX = "installed:"
"""The prefix of the name of an installed package: `installed:std_msgs`. For px4_msgs, it is only needed if `installed`
is also a path."""

PREFIXES = "AMENT_PREFIX_PATH"
"""The environment variable with the folders of an installation, which its setup script sets."""

_WORKSPACE = "install"
"""The folder in which colcon installs, below that of the workspace."""

_SYSTEM = "/opt/ros"
"""The folder with a folder for each distribution of ROS 2."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")


class Installed(NamedTuple):
    """An installed package: its name, its folder, and the folders that come after it and have the same package."""

    package: str
    path: str
    others: tuple[str, ...]

    def notice(self, text: str) -> Diagnostic:
        """Return a note on the folder that the source `text` is read from."""
        also = f", which comes before {few(self.others)}" if self.others else ""
        return Diagnostic(Location(text, 0), "S133", f"{self.path} is read{also}")


def share_folders() -> list[str]:
    """Return the folders of packages that `AMENT_PREFIX_PATH` names, in its order, which is that of ROS."""
    return [os.path.join(each, "share") for each in os.environ.get(PREFIXES, "").split(os.pathsep) if each]


def names_installed(text: str) -> bool:
    """Whether `text` names an installed package, existing or not."""
    return text == INSTALLED or text.startswith(PREFIX)


def find_installed(text: str) -> Installed:
    """Return the installed package that `text` names. Raises InputError if there is none, or `text` is also a path."""
    package = _package_of(text)
    problem = wrong_installed(text)
    if problem:
        raise input_error(text, "S132", problem, 0)
    first, *others = _folders(package)
    return Installed(package, first, tuple(others))


def wrong_installed(text: str, folder: str = os.curdir) -> str:
    """Return an error message for the name of a package that is not installed, "" if it is.

    It is also an error if `text` is a path in `folder`, because either could be meant.
    """
    package = _package_of(text)
    path = os.path.join(folder, text)
    if text == INSTALLED and os.path.lexists(path):
        ways = f"write '{os.path.join(os.curdir, text)}' for the path, or '{PREFIX}{package}' for the package"
        return f"a path, and the name of the installed {package}: {ways}"
    if not _NAME.fullmatch(package):
        return f"'{package}' is not a ROS package name: expected a name such as '{PREFIX}{_package_of(INSTALLED)}'"
    return "" if _folders(package) else _absence(package)


def _package_of(text: str) -> str:
    from msggen.definitions.model import DEFAULT_PACKAGE  # not above: most builds need no model

    return DEFAULT_PACKAGE if text == INSTALLED else text.removeprefix(PREFIX)


def _folders(package: str) -> list[str]:
    """Return the folders of a package, each once, the one that ROS takes first."""
    found: dict[str, str] = {}
    for share in _all_share_folders(package):
        path = os.path.join(share, package)
        if os.path.isdir(path):
            found.setdefault(os.path.realpath(path), path)
    return list(found.values())


def _all_share_folders(package: str) -> Iterator[str]:
    """Yield the folders that can have a package: of the environment, the workspace, and each distribution of ROS.

    colcon installs each package into a folder of its own, or with `--merge-install` all into one. Of the
    distributions, the later in the alphabet is the newer.
    """
    yield from share_folders()
    yield os.path.join(_WORKSPACE, package, "share")
    yield os.path.join(_WORKSPACE, "share")
    for distribution in sorted(_names(_SYSTEM), reverse=True):
        yield os.path.join(_SYSTEM, distribution, "share")


def _absence(package: str) -> str:
    """Return where a package was looked for, and what to do. For others than px4_msgs, it can be the nearest name."""
    folders = () if package == _package_of(INSTALLED) else (_WORKSPACE, *_all_share_folders(package))
    near = suggestion(package, {name for each in folders for name in _names(each) if _NAME.fullmatch(name)})
    environment = PREFIXES if share_folders() else f"{PREFIXES}, which is not set"
    places = f"not in the folders of {environment}, not in '{_WORKSPACE}' here, and not in {_SYSTEM}"
    return f"{package} is not installed{near or f': {places}; source the setup file of its workspace'}"


def _names(folder: str) -> list[str]:
    try:
        return os.listdir(folder)
    except OSError:
        return []
