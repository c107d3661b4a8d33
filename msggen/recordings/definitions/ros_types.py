"""The standard types of ROS 2, such as `sensor_msgs/msg/Imu`: of an installation, a folder, or rosbags' tables."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache

from msggen.base.diagnostics import Level
from msggen.base.disk.reading import read_text
from msggen.definitions.parse.definition import parse_message
from msggen.recordings.source.source import SEPARATOR

Find = Callable[[str, str], Sequence[str]]
"""Returns the definitions for the name of a topic, which does not matter here, and its type."""
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)", re.ASCII)
_PREFIXES = "AMENT_PREFIX_PATH"
"""The environment variable with the folders of an installation, which its setup script sets."""
_RELEASES = ("ros2_humble", "ros2_foxy", "latest")
"""The tables of rosbags that are tried, in this order: releases up to Humble write no definitions."""
_MOST = 256
"""How many types a definition may nest. Those of ROS nest some ten."""


def standard_types() -> Iterator[tuple[str, Find]]:
    """Yield the names and the definitions of what has the standard types here, the most likely first."""
    prefixes = [each for each in os.environ.get(_PREFIXES, "").split(os.pathsep) if each]
    if prefixes:
        yield f"the ROS of {_PREFIXES}", _found_in([os.path.join(each, "share") for each in prefixes])
    for release in _RELEASES:
        find = _of_rosbags(release)
        if find is not None:
            yield f"the table '{release}' of rosbags", find


def types_in(folder: str) -> Find | None:
    """Return the definitions in a folder of packages, or of an installation of ROS. None for another folder.

    A folder with a folder `msg` is a package or a firmware itself.
    """
    if os.path.isdir(os.path.join(folder, "msg")):
        return None
    for root in (os.path.join(folder, "share"), folder):
        try:
            names = os.listdir(root)
        except OSError:
            continue
        if any(os.path.isdir(os.path.join(root, name, "msg")) for name in names):
            return _found_in([root])
    return None


def _found_in(roots: Sequence[str]) -> Find:
    """Return the definitions in folders of packages: `sensor_msgs/msg/Imu.msg`."""

    @lru_cache(1024)
    def text_of(package: str, name: str) -> str | None:
        for root in roots:
            try:
                return read_text(os.path.join(root, package, "msg", f"{name}.msg"), "replace")
            except OSError:
                continue
        return None

    def find(_: str, ros_type: str) -> list[str]:
        text = _assembled(ros_type, text_of)
        return [] if text is None else [text]

    return find


def _assembled(ros_type: str, text_of: Callable[[str, str], str | None]) -> str | None:
    """Return a definition in the format `ros2msg` with all that it nests, None if one is missing or has an error."""
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
