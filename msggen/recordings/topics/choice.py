"""The topics that a user chooses, by any of their names, with `*` and `?`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from msggen.base.diagnostics import suggestion
from msggen.messages.names import stem_of
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from msggen.recordings.topics.topic import Topic


class Choice(NamedTuple):
    """The topics whose names match one of `wanted`, or all if there is none, without those that match `excluded`."""

    wanted: Sequence[str] = ()
    excluded: Sequence[str] = ()

    def takes(self, name: str, ros_type: str) -> bool:
        """Whether a topic is chosen."""
        names = frozenset(names_of(name, ros_type))
        is_wanted = not self.wanted or _is_one_of(names, self.wanted)
        return is_wanted and not _is_one_of(names, self.excluded)

    def problem(self, topics: Iterable[tuple[str, str]]) -> str:
        """Return what is wrong if a pattern matches none of `topics`, pairs of name and type; otherwise ""."""
        known = [frozenset(names_of(*topic)) for topic in topics]
        for pattern in (*self.wanted, *self.excluded):
            if not any(_is_one_of(names, [pattern]) for names in known):
                near = sorted({name for names in known for name in names})
                return f"no topic is called '{pattern}'{suggestion(pattern, near)}"
        return ""


_LONGEST = 512
"""The most characters of a name whose ends are names too. DDS allows half as many."""
_NUMBERED = re.compile(r"(.+?)(?:\[(\d{1,3})\]|[_ ](\d{1,3}))")


def split_instance(name: str) -> tuple[str, int] | None:
    """Return the name and the number of `sensor_gps[1]`, `sensor_gps_1` or `sensor_gps 1`, None without a number."""
    found = _NUMBERED.fullmatch(name)
    return (found[1], int(found[2] or found[3])) if found else None


def takes_instance(pattern: str, topic: Topic) -> bool:
    """Whether a pattern takes a topic: by a name, which is that of all instances, or with the number of its instance.

    In ROS 2, instances are topics of their own: `sensor_gps[1]` takes `/fmu/out/sensor_gps_1`, too.
    """
    if _takes(pattern, topic):
        return True
    numbered = split_instance(pattern)
    if numbered is None:
        return False
    name, number = numbered
    return (topic.instance == number and _takes(name, topic)) or _takes(f"{name}_{number}", topic)


def _takes(pattern: str, topic: Topic) -> bool:
    """Whether a pattern takes a topic, by its own name or by the one that it shares with its other definitions."""
    names = {topic.name, topic.recorded_name}
    return any(Choice([pattern]).takes(name, topic.ros_type) for name in names)


def listed(names: Iterable[Any]) -> list[Any]:
    """Return names as a list. A text is one name, and so is a topic with the number of its instance."""
    return [names] if isinstance(names, str) or is_numbered(names) else list(names)


def is_numbered(key: object) -> TypeGuard[tuple[str, int]]:
    """Whether a key is the name of a topic with the number of its instance."""
    return isinstance(key, tuple) and len(key) == 2 and isinstance(key[0], str) and isinstance(key[1], Integral)  # noqa: PLR2004


def checked_time(name: str, value: object, least: float = 0) -> float | None:
    """Return a time in s, or None. Raises TypeError if it is no number, RecordingError if it is NaN or too small."""
    if value is None:
        return None
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError(f"{name}: expected a time in s, got {value!r}")
    if not float(value) >= least:
        raise RecordingError(f"{name}: expected a time in s of {least:g} or more, got {value}")
    return float(value)


def check_times(start: object, stop: object) -> None:
    """Raise RecordingError or TypeError unless a recording can be read from `start` up to `stop`, each in s or None."""
    begin = checked_time("start", start)
    checked_time("stop", stop, begin or 0)


def names_of(name: str, ros_type: str) -> Iterator[str]:
    """Yield the names of a topic, such as vehicle_status for `/uav_1/fmu/out/vehicle_status_v4`.

    They are the ROS name and its ends, each with and without the version, and the message and its ROS type.
    """
    for each in (name, stem_of(name)):
        yield each
        parts = each.strip("/").split("/") if len(each) <= _LONGEST else []
        for start in range(len(parts)):
            rest = "/".join(parts[start:])
            yield rest
            yield f"/{rest}"
    yield ros_type
    yield ros_type.rpartition("/")[2]


def _is_one_of(names: Iterable[str], patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)
