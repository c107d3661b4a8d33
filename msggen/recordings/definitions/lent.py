"""Definitions for topics that have none in their recording: of a package, of a firmware, or of an embedded release.

A definition is used only if it fits the samples: a definition of another release can have the name of the topic, and
its values would be wrong without an error.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from types import ModuleType
from typing import NamedTuple

from msggen.base.diagnostics import InputError, few
from msggen.messages.names import version_of
from msggen.recordings.decode.decoder import Decoder
from msggen.recordings.decode.schemas import definition_of, read_schema, type_hash_of
from msggen.recordings.definitions.ros_types import is_unnamed, standard_types, types_in
from msggen.recordings.source.source import Channel, Part, SchemaError, Source

Definitions = ModuleType | str | os.PathLike[str]
"""A generated package; a ROS package, a firmware or another source of `msggen.read`; or a release: "v1.17"."""

_LOOKED_AT = 1 << 18
"""How many samples are read at most, to find one of each topic."""
_SAMPLES = 64
"""How many samples of a topic are compared with a definition."""
_TRIED = 16
"""How many definitions of a topic in other files of a recording are tried."""
_BRIDGE = re.compile("/fmu/(?:in|out)/.*")
"""The name of a topic of PX4 without the namespace of the vehicle."""
_PX4 = "px4_msgs/"
_RULES_OF_UORB = frozenset({"M301", "M306", "M307", "M401"})
"""Errors of a firmware's definitions that those of other ROS packages can have."""
_IS_HASH = re.compile("RIHS01_[0-9a-f]{64}")


class Nearby(NamedTuple):
    """Definitions that are tried beside those of the releases, if any are needed."""

    find: Callable[[], tuple[ModuleType, str] | None]
    """Returns a package and its name for people, or None."""


class Lender(NamedTuple):
    """A set of definitions."""

    name: str
    definitions_of: Callable[[str, str], Sequence[str]]
    """Returns the definitions for the name and the ROS type of a topic, the most likely first."""
    topics: frozenset[str] = frozenset()
    """The names of the topics of a release in ROS."""
    is_of_px4: bool = True
    """Whether PX4's types are expected here, and not in `otherwise` or a release."""
    otherwise: Nearby | None = None


NOBODY = Lender("", lambda *_: (), is_of_px4=False)
"""No set of definitions: those of the releases are taken."""


class Lent(NamedTuple):
    """The definitions that were found, by the numbers of the source and of the channel."""

    definitions: Mapping[tuple[int, int], str]
    notes: Sequence[str]
    """The choices and their reasons, a line each."""
    recorded: Collection[tuple[int, int]] = ()
    """The channels whose definitions are from other channels of the recording."""


class _Wanted(NamedTuple):
    """A channel without a definition, with some of its samples if there are any."""

    key: tuple[int, int]
    channel: Channel
    part: Part | None

    @property
    def names(self) -> tuple[str, str]:
        """The name and the type of the topic."""
        return self.channel.topic, self.channel.ros_type


def lender_of(definitions: Definitions | Nearby | list[Definitions | Nearby]) -> Lender:
    """Return the definitions of packages, folders, a firmware or a release. Raises InputError, and TypeError.

    Of several, the first one that has a type is taken.
    """
    if isinstance(definitions, Nearby):
        return NOBODY._replace(otherwise=definitions)
    if isinstance(definitions, ModuleType):
        from msggen.messages.packages import packages_of

        return _of_package(*packages_of(definitions))
    if isinstance(definitions, list):
        return _joined(list(map(lender_of, definitions)))
    path = os.fspath(definitions)
    find = types_in(path)
    if find is None:
        return _of_catalog(path)
    own = Lender(path, find, is_of_px4=False)
    return _of_unnamed(own) if is_unnamed(path) else own


def _joined(lenders: Sequence[Lender]) -> Lender:
    def find(name: str, ros_type: str) -> list[str]:
        return [text for each in lenders for text in each.definitions_of(name, ros_type)]

    topics = frozenset(topic for each in lenders for topic in each.topics)
    is_of_px4 = any(each.is_of_px4 for each in lenders)
    otherwise = next((each.otherwise for each in lenders if each.otherwise is not None), None)
    return Lender(few([each.name for each in lenders if each.name]), find, topics, is_of_px4, otherwise)


def _of_unnamed(package: Lender) -> Lender:
    """Return the definitions of a folder without a package.xml, which can also be a folder of PX4's definitions."""
    try:
        return _joined([package, _of_catalog(package.name)])
    except InputError as error:
        if {each.code for each in error.diagnostics} <= _RULES_OF_UORB:
            return package
        raise


def lend(sources: Sequence[Source], lender: Lender, check_open: Callable[[], None]) -> Lent:
    """Find definitions for the channels of CDR that have none: of `lender`, or else of an embedded release.

    Of the releases and what is `Nearby`, that one is taken whose definitions fit the samples of the most topics.
    `check_open` is called before samples are read.
    """
    lacking = {
        (number, channel.number): channel
        for number, source in enumerate(sources)
        for channel in source.channels.values()
        if channel.lacks_definition
    }
    if not lacking:
        return Lent({}, ())
    check_open()
    wanted = _with_samples(sources, lacking)
    recorded = _fitting([each for each in wanted if not each.channel.definition_format], _of_recording(sources))
    others = _from_elsewhere([each for each in wanted if each.key not in recorded], lender)
    return Lent({**recorded, **others.definitions}, others.notes, recorded.keys())


def _from_elsewhere(wanted: Sequence[_Wanted], lender: Lender) -> Lent:
    """Find definitions that are not in the recording. Standard types are not PX4's, and have a source of their own."""
    others = [
        each for each in wanted if not (each.channel.ros_type.startswith(_PX4) or lender.definitions_of(*each.names))
    ]
    standard = _of_standard_types(others)
    found = _from_lender([each for each in wanted if each.key not in standard.definitions], lender)
    hint = _hint([each for each in others if each.key not in standard.definitions])
    return Lent({**standard.definitions, **found.definitions}, (*found.notes, *standard.notes, *hint))


def _of_standard_types(wanted: Sequence[_Wanted]) -> Lent:
    """Find definitions of the standard types of ROS."""
    found: dict[tuple[int, int], str] = {}
    notes: list[str] = []
    rest = list(wanted)
    for name, find in standard_types() if wanted else ():
        fitting = _fitting(rest, Lender(name, find))
        if fitting:
            own = [each for each in rest if each.key in fitting]
            notes += _notes(own, fitting, Lender(name, find), "which has them")
            rest = [each for each in rest if each.key not in fitting]
            found.update(fitting)
        if not rest:
            break
    return Lent(found, notes)


def _hint(wanted: Sequence[_Wanted]) -> Iterator[str]:
    """Yield where the types of other packages could come from."""
    packages = sorted({each.channel.ros_type.partition("/")[0] for each in wanted} - {""})
    if packages:
        text = f"name the folder of their package, --msg-dir {packages[0]}=DIR, or source the setup of a ROS 2 that has"
        yield f"for the types of {few(packages)}, {text} them"


def _from_lender(wanted: Sequence[_Wanted], lender: Lender) -> Lent:
    """Find definitions in `lender`, and those that it cannot have in what is near and in the releases."""
    asked = [each for each in wanted if lender.is_of_px4 or lender.definitions_of(*each.names)]
    found = _fitting(asked, lender)
    others = _from_releases([each for each in wanted if each not in asked], lender.otherwise)
    notes = _notes(asked, found, lender, "as asked for") if asked else []
    return Lent({**found, **others.definitions}, (*notes, *others.notes))


def _from_releases(wanted: Sequence[_Wanted], nearby: Nearby | None) -> Lent:
    """Find definitions in what is near, or in the release that fits best."""
    if not wanted:
        return Lent({}, ())
    package = nearby.find() if nearby is not None else None
    near = [_of_package(package[0])._replace(name=package[1])] if package is not None else []
    chosen, found = None, {}
    best: tuple[int, ...] = (0,)
    for each in (*near, *_releases(wanted)):
        fitting = _fitting(wanted, each)
        names = {match[0] for one in wanted if (match := _BRIDGE.search(one.channel.topic))}
        likeness = len(names) if each in near else len(names & each.topics)  # equal ones do not replace it
        score = sum(one.part is not None and one.key in fitting for one in wanted), likeness
        if fitting and score > best:
            best, chosen, found = score, each, fitting
    if chosen is None:
        return Lent({}, (f"{_topics(wanted)} in the recording, and no embedded release fits",))
    why = "which fits best" if chosen in near else "the embedded release that fits best"
    return Lent(found, _notes(wanted, found, chosen, why))


def _notes(wanted: Sequence[_Wanted], found: Mapping[tuple[int, int], str], lender: Lender, why: str) -> list[str]:
    notes = [f"{_topics(wanted)} in the recording; {len(found)} taken from {lender.name}, {why}"]
    unseen = [each for each in wanted if each.key in found and each.part is None]
    if unseen:
        notes.append(f"not compared with samples: {few([each.channel.topic for each in unseen])}")
    for each in wanted:
        if each.key not in found:
            name, ros_type = each.channel.topic, each.channel.ros_type
            has_any = bool(lender.definitions_of(name, ros_type))
            reason = "does not fit its samples" if has_any else "is not there"
            notes.append(f"{name} has no definition: that of {ros_type} in {lender.name} {reason}")
    return notes


def _topics(wanted: Sequence[_Wanted]) -> str:
    text = "1 topic has no definition" if len(wanted) == 1 else f"{len(wanted)} topics have no definitions"
    return f"{text} as ros2msg" if any(each.channel.definition_format for each in wanted) else text


def _with_samples(sources: Sequence[Source], lacking: Mapping[tuple[int, int], Channel]) -> list[_Wanted]:
    """Return the channels with some samples of each, as far as the first samples of each file have them."""
    found: dict[tuple[int, int], Part] = {}
    for number, source in enumerate(sources):
        missing = {channel for of, channel in lacking if of == number}
        count = 0
        for part in source.parts(missing) if missing else ():
            if part.channel in missing and len(part.starts):
                missing.remove(part.channel)
                found[number, part.channel] = _kept(part)
            count += len(part.starts)
            if not missing or count > _LOOKED_AT:
                break
    return [_Wanted(key, channel, found.get(key)) for key, channel in lacking.items()]


def _kept(part: Part) -> Part:
    """Return a copy of the first samples of a part, which stays valid."""
    starts, sizes = part.starts[:_SAMPLES], part.sizes[:_SAMPLES]
    low, high = int(starts.min()), int((starts + sizes).max())
    return part._replace(
        buffer=part.buffer[low:high].copy(),
        starts=starts - low,
        sizes=sizes,
        log_times=part.log_times[:_SAMPLES],
        publish_times=None,
    )


def _fitting(wanted: Sequence[_Wanted], lender: Lender) -> dict[tuple[int, int], str]:
    """Return the definitions that fit."""
    found = {}
    for each in wanted:
        for text in lender.definitions_of(each.channel.topic, each.channel.ros_type):
            if _fits(each.channel, text, each.part):
                found[each.key] = text
                break
    return found


def _fits(channel: Channel, definition: str, part: Part | None) -> bool:
    """Whether any sample has the size of a definition, and the definition has the type hash of the recording."""
    told = channel.type_hash
    try:
        if _IS_HASH.fullmatch(told) and told != type_hash_of(channel.ros_type, definition):
            return False
        decoder = Decoder(channel._replace(definition=definition))
    except SchemaError:
        return False
    return part is None or len(decoder.rows(part).rows) > 0


# where definitions come from


def _of_recording(sources: Sequence[Source]) -> Lender:
    """Return the definitions of the same topics in other files: rosbag2 can write a definition to some files only."""
    found: dict[tuple[str, str], dict[str, None]] = defaultdict(dict)
    for source in sources:
        for channel in source.channels.values():
            if channel.definition and channel.is_cdr:
                found[channel.topic, channel.ros_type][channel.definition] = None

    def find(name: str, ros_type: str) -> list[str]:
        return list(islice(found.get((name, ros_type), ()), _TRIED))

    return Lender("the recording", find)


def _of_package(package: ModuleType) -> Lender:
    from msggen.messages.packages import classes_of

    def find(name: str, ros_type: str) -> list[str]:
        infos = [cls.__msg__ for cls in classes_of(package, name, ros_type)]
        infos.sort(key=lambda info: info.message_version != version_of(name))
        return [info.definition for info in infos]

    return Lender(package.__name__, find)


@lru_cache(16)
def _of_catalog(source: str) -> Lender:
    """Return the definitions of a source of `msggen.read`. Raises InputError."""
    from msggen.messages.firmware import releases
    from msggen.sources.read import read

    try:
        catalog = read(source, archived=True)
    except InputError:  # many sources have no archived versions
        catalog = read(source)

    def find(name: str, ros_type: str) -> list[str]:
        package, _, message = ros_type.replace("/msg/", "/").partition("/")
        current = catalog.messages.get(f"{package}/{message}")
        if current is None:
            return []
        wanted = version_of(name)
        versions = sorted(
            catalog.versions(current), key=lambda each: (each.message_version != wanted, -each.message_version)
        )
        texts = [definition_of(catalog, each) for each in versions]
        return [text for text in texts if _can_be_read(ros_type, text)]

    return Lender(source, find, frozenset(releases().get(source, ())))


def _can_be_read(ros_type: str, definition: str) -> bool:
    try:
        read_schema(ros_type, definition)
    except SchemaError:
        return False
    return True


def _releases(wanted: Sequence[_Wanted]) -> list[Lender]:
    """Return the embedded releases, the newest first, or none if they cannot have any of the types."""
    from msggen.sources.embedded import EMBEDDED

    has_any = any(each.channel.ros_type.startswith(_PX4) for each in wanted)
    return [_of_catalog(release) for release in EMBEDDED] if has_any else []
