"""The topics that a user chooses, by any of their names, with `*` and `?`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from msggen.diagnostics import suggestion
from msggen.live.names import stem_of


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


def names_of(name: str, ros_type: str) -> Iterator[str]:
    """Yield the names of a topic, such as vehicle_status for `/uav_1/fmu/out/vehicle_status_v4`.

    They are the ROS name and its ends, each with and without the version, and the message and its ROS type.
    """
    for each in (name, stem_of(name)):
        yield each
        parts = each.strip("/").split("/")
        for start in range(len(parts)):
            rest = "/".join(parts[start:])
            yield rest
            yield f"/{rest}"
    yield ros_type
    yield ros_type.rpartition("/")[2]


def _is_one_of(names: Iterable[str], patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(name, pattern) for name in names for pattern in patterns)
