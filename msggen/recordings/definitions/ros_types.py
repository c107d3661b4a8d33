"""Types of ROS packages: those of one's own, and standard ones such as `sensor_msgs/msg/Imu`.

`standard_types.txt` has the messages of ROS 2 Humble, whose recordings have no definitions.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache

from msggen.base.diagnostics import Level
from msggen.base.disk.reading import read_bytes, read_text
from msggen.base.disk.resources import module_text
from msggen.definitions.model import DEFAULT_PACKAGE
from msggen.definitions.parse.definition import parse_message
from msggen.definitions.parse.package_xml import package_name
from msggen.recordings.source.source import SEPARATOR
from msggen.sources.installed import PREFIXES, share_folders

Find = Callable[[str, str], Sequence[str]]
"""Returns the definitions for the name of a topic, which does not matter here, and its type."""
TextOf = Callable[[str, str], str | None]
"""Returns the text of a message by its package and its name, or None."""
_MANIFEST = "package.xml"
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)", re.ASCII)
_RELEASES = ("ros2_foxy", "latest")
"""The tables of rosbags that are tried, in this order."""
_MOST = 256
"""How many types a definition may nest. Those of ROS nest some ten."""


def standard_types() -> Iterator[tuple[str, Find]]:
    """Yield the names and the definitions of what has the standard types here, the most likely first."""
    folders = share_folders()
    if folders:
        yield f"the ROS of {PREFIXES}", _found_by(_text_below(folders))
    yield "msggen's table of ROS 2 Humble", _found_by(_embedded_text)
    for release in _RELEASES:
        find = _of_rosbags(release)
        if find is not None:
            yield f"the table '{release}' of rosbags", find


def types_in(source: str) -> Find | None:
    """Return the definitions in a ROS package, a folder of packages, or an installation of ROS. None for other sources.

    A package is `PKG=DIR`, or a folder with a folder `msg`; without a package.xml, it is named after its folder. PX4's
    firmware and its packages are other sources. Raises InputError for a package.xml that cannot be read.
    """
    package, mark, folder = source.partition("=")
    if mark and not os.path.exists(source):
        return _found_by(_text_in(package, folder))
    if os.path.isdir(os.path.join(source, "msg")):
        return None if _is_of_px4(source) else _found_by(_text_in(_name_of(source), source))
    for root in (os.path.join(source, "share"), source):
        try:
            names = os.listdir(root)
        except OSError:
            continue
        if any(os.path.isdir(os.path.join(root, name, "msg")) for name in names):
            return _found_by(_text_below([root]))
    return None


def is_unnamed(folder: str) -> bool:
    """Whether a folder with definitions has no package.xml, so that only its name tells the package."""
    return os.path.isdir(os.path.join(folder, "msg")) and not os.path.isfile(os.path.join(folder, _MANIFEST))


def _is_of_px4(folder: str) -> bool:
    """Whether a folder with a folder `msg` is a PX4-Autopilot tree or px4_msgs."""
    is_tree = os.path.isdir(os.path.join(folder, "src"))
    return is_tree or _name_of(folder) == DEFAULT_PACKAGE


def _name_of(folder: str) -> str:
    path = os.path.join(folder, _MANIFEST)
    if not os.path.isfile(path):
        return os.path.basename(os.path.abspath(folder))
    return package_name(read_bytes(path), path)


def _text_in(package: str, folder: str) -> TextOf:
    """Return the texts in the folder of a package, and in the folders beside it."""
    beside = _text_below([os.path.dirname(os.path.abspath(folder))])

    def text_of(of: str, name: str) -> str | None:
        if of != package:
            return beside(of, name)
        paths = (os.path.join(folder, *inner, f"{name}.msg") for inner in (("msg",), ()))
        return _first_text(paths)

    return text_of


def _text_below(roots: Sequence[str]) -> TextOf:
    """Return the texts in folders of packages: `sensor_msgs/msg/Imu.msg`."""

    @lru_cache(1024)
    def text_of(package: str, name: str) -> str | None:
        return _first_text(os.path.join(root, package, "msg", f"{name}.msg") for root in roots)

    return text_of


def _first_text(paths: Iterable[str]) -> str | None:
    for path in paths:
        with suppress(OSError):
            return read_text(path, "replace")
    return None


def _embedded_text(package: str, name: str) -> str | None:
    return _embedded().get(f"{package}/{name}")


@lru_cache
def _embedded() -> dict[str, str]:
    """Return the table of standard types, by names such as `sensor_msgs/Imu`."""
    _, *blocks = module_text("recordings/definitions/standard_types.txt").split("MSG: ")
    return {name: text for name, _, text in (block.partition("\n") for block in blocks)}


def _found_by(text_of: TextOf) -> Find:
    def find(_: str, ros_type: str) -> list[str]:
        text = _assembled(ros_type, text_of)
        return [] if text is None else [text]

    return find


def _assembled(ros_type: str, text_of: TextOf) -> str | None:
    """Return a definition in the format `ros2msg` with all that it nests, None if one is missing or has an error.

    Standard types that it nests may be those of msggen's table.
    """
    found: dict[str, str] = {}
    waiting = [ros_type]
    while waiting:
        name = _TYPE.fullmatch(waiting.pop())
        if name is None or len(found) > _MOST:
            return None
        key = "/".join(name.groups())
        if key in found:
            continue
        text = text_of(*name.groups())
        if text is None and found:
            text = _embedded_text(*name.groups())
        if text is None:
            return None
        message, errors = parse_message(text, key, name[2], name[1], of_uorb=False)
        if any(each.level is Level.ERROR for each in errors):
            return None
        found[key] = text if text.endswith("\n") else f"{text}\n"
        waiting += [message.key_of(field.type) for field in reversed(message.fields) if not field.type.is_primitive]
    own, *nested = found.items()
    return own[1] + "".join(f"{SEPARATOR}\nMSG: {key}\n{text}" for key, text in nested)


@lru_cache
def _of_rosbags(release: str) -> Find | None:
    """Return the definitions that rosbags has of a release, None if it is not installed, or does not have it."""
    try:
        from rosbags.typesys import Stores, get_typestore
        from rosbags.typesys.base import TypesysError

        store = get_typestore(Stores(release))
    except (ImportError, ValueError):
        return None

    def find(_: str, ros_type: str) -> list[str]:
        if not _TYPE.fullmatch(ros_type):
            return []
        try:
            return [store.generate_msgdef(ros_type, ros_version=2)[0]]
        except (TypesysError, KeyError):
            return []

    return find
