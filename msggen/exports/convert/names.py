"""Names of files for topics, as PX4's flight-review-rs has them: `vehicle_status`, `sensor_gps_1`; and of folders."""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from msggen.messages.names import is_named_after, stem_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from msggen.recordings.topics.topic import Topic

PARAMETERS, TEXTS, EVENTS, DROPOUTS = "ulog_parameters", "ulog_texts", "ulog_events", "ulog_dropouts"
FACT_TABLES = (PARAMETERS, TEXTS, EVENTS, DROPOUTS)
"""The names of tables of what a ULog has beside its topics."""
FINDINGS = "findings"
"""The name of the table of what a fleet's flights show."""
_TAKEN = frozenset({*FACT_TABLES, FINDINGS})
"""The names that no topic has."""
_STRANGE = re.compile(r"[^A-Za-z0-9_.-]")
_PX4 = re.compile(r"(?:/(.+))?/fmu/(in|out)/([^/]+)")
"""The topics of PX4 in ROS 2: namespace, direction, and the name in uORB with the number of the instance."""
_INSTANCE = re.compile(r"(?!actuator_controls(?:_status)?_\d$)(.+)_([1-9])")
"""A name with the number of an instance: uORB has 10 of them. The only topics of uORB whose own names end in a number
are actuator_controls_0 to _3 and actuator_controls_status_0 and _1."""
_DIGITS = 8
_LONGEST = 150
"""The length of a name in characters; file systems take 255 bytes."""


def file_names(topics: Iterable[Topic]) -> dict[tuple[str, int], str]:
    """Return a name for each topic, by name and instance, without a suffix. No two differ in case only.

    It is the name in uORB with the instance if that is not 0. Where several topics have that, as `/fmu/in/x` and
    `/fmu/out/x`, the next ones have their whole name: `fmu_out_x`. None has the name of another table.
    """
    found: dict[tuple[str, int], str] = {}
    taken = {*_TAKEN}
    numbers: Mapping[str, Iterator[int]] = defaultdict(partial(count, 2))
    for topic in topics:
        name = next(each for each in _candidates(topic, numbers) if each.casefold() not in taken)
        taken.add(name.casefold())
        found[topic.name, topic.instance] = name
    return found


class Place(NamedTuple):
    """What a topic is in all recordings, whatever other topics they have."""

    name: str
    """`vehicle_command` for /fmu/out/vehicle_command and for a ULog's vehicle_command, `fmu_in_vehicle_command` for
    /fmu/in/vehicle_command, `camera.info` for /camera/info."""
    namespace: str
    """`uav_1` for /uav_1/fmu/out/vehicle_command, "" without one. Topics of other programs have it in their names."""
    instance: int
    """The instance: 1 for /fmu/out/sensor_gyro_1, too."""


def place_of(topic: Topic) -> Place:
    """Return the place of a topic among those of many recordings: the same for all versions of a topic of PX4."""
    name = topic.channels[0][1].topic
    found = _PX4.fullmatch(stem_of(name))
    if found is None:
        return Place(_unique(name.strip("/").replace("/", ".")), "", topic.instance)
    namespace, direction, uorb = found.groups("")
    is_whole = is_named_after(uorb, topic.ros_type.rpartition("/")[2])  # `powers_of_2` of PowersOf2
    numbered = None if is_whole else _INSTANCE.fullmatch(uorb)
    uorb, number = (numbered[1], int(numbered[2])) if numbered else (uorb, topic.instance)
    name = uorb if direction == "out" else f"fmu_in_{uorb}"
    return Place(_unique(name), _unique(namespace.replace("/", ".")) if namespace else "", number)


def _unique(name: str) -> str:
    """Return a name as that of a folder. Where others could become the same, it ends with a digest."""
    clean = _clean(name, "")
    if clean == name.lower() and clean not in _TAKEN:
        return clean
    return f"{clean}-{hashlib.sha256(name.encode(errors='surrogateescape')).hexdigest()[:_DIGITS]}"


def _candidates(topic: Topic, numbers: Mapping[str, Iterator[int]]) -> Iterator[str]:
    """Yield names for a topic. `numbers` are those that no topic has yet behind a name."""
    whole = topic.channels[0][1].topic
    end = f"_{topic.instance}" if topic.instance else ""
    for name in (stem_of(whole).rpartition("/")[2], whole.strip("/").replace("/", "_")):
        yield _clean(name, end)
    for number in numbers[_clean(name, end).casefold()]:
        yield _clean(name, f"{end}-{number}")


def _clean(name: str, end: str) -> str:
    """Return a name that no file system refuses, that stays in its folder, and that no engine skips."""
    return _STRANGE.sub("_", name)[:_LONGEST].lstrip("._") + end or "topic"
