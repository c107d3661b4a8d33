"""Recordings of rosbag2: a folder with metadata.yaml and files, which can be compressed, as can single samples."""

from __future__ import annotations

import ntpath
import os
import re
import tempfile
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

import numpy as np

from msggen.base.diagnostics import InputError, either, few
from msggen.base.disk.output import link_in
from msggen.base.disk.reading import read_bytes
from msggen.base.recording_formats import FORMATS, MCAP, PACKED, format_named, unpacked
from msggen.recordings.files.compression import LARGEST, CompressionError, Room, decompress_file, decompress_frame
from msggen.recordings.files.paths import METADATA, is_always_whole, is_bag
from msggen.recordings.source.source import (
    FOREVER,
    Attached,
    Channel,
    Checksums,
    Facts,
    Part,
    Problem,
    RecordingError,
    Source,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

ZSTD = b"\x28\xb5\x2f\xfd"
_STORAGES = {each.storage: f"*{each.suffix}" for each in FORMATS.values() if each.storage}
"""The files of each storage."""
_NEWEST = 9
"""The newest version of metadata.yaml that is known."""
_WITH_FOLDER = 4
"""Before this version, the paths of files begin with the name of the folder."""
_LARGEST_COUNT = 1 << 63
_BATCH = 16 << 20
"""The bytes of samples that are decompressed at a time, unless one sample is larger."""


class Metadata(NamedTuple):
    """The contents of a metadata.yaml."""

    paths: Sequence[str]
    counts: Mapping[str, int]
    """How many messages each file has, by the name of the file. Before version 5 there are none."""
    total: int | None
    """How many messages all files have."""
    is_by_sample: bool
    """Whether each sample is compressed by itself."""
    problems: Sequence[str] = ()


def open_folder(path: str, open_file: Callable[[str, Room], Source]) -> list[Source]:
    """Return the files of a recording of rosbag2 in their order. `open_file` opens one, without compression.

    What is wrong with the folder is among the problems of the first file. Raises RecordingError, and OSError.
    """
    recordings = sorted(filter(format_named, os.listdir(path)))
    found = [name for name in recordings if not is_always_whole(name)]
    names = [name for name in found if os.path.isfile(os.path.join(path, name))]
    others = sorted({*found} - {*names})
    problems = [Problem(f"{name} is left out: this is not a file") for name in others]
    if not is_bag(path):
        _check_one(path, [*names, *filter(is_always_whole, recordings)])
    metadata = _metadata_of(path, problems)
    named, missing, further = _chosen(path, metadata, sorted(names, key=_in_order))
    for name in missing:
        count = metadata.counts.get(os.path.basename(name), 0) if metadata else 0
        wrong = "is missing" if _is_below(path, name) else "is not in the folder of the recording, and is not read"
        problems.append(Problem(f"{name}, which {METADATA} names, {wrong}", samples=count))
    if not named and not further:
        if not os.path.lexists(os.path.join(path, METADATA)):
            raise RecordingError(
                f"{path} is not a recording: a folder without {METADATA}, {' and '.join(_STORAGES.values())}"
            )
        text = "; ".join(problem.text for problem in problems)
        expected = either(sorted(_STORAGES.values()))
        raise RecordingError(f"{path} is not a recording: {text}, and there is no file {expected}")
    room = Room(sum(map(os.path.getsize, (*named, *further))))
    sources = list(_opened(named, open_file, metadata, problems, room))
    is_whole = not missing and len(sources) == len(named)
    if metadata is not None and further:
        is_left_out = is_whole and _is_complete(metadata, sources)
        text = f"is not in {METADATA}, and is {'not read' if is_left_out else 'read too'}"
        problems += [Problem(f"{os.path.basename(each)} {text}") for each in further]
        further = [] if is_left_out else further
    sources += _opened(further, open_file, metadata, problems, room)
    if not sources:
        raise RecordingError("; ".join(problem.text for problem in problems))
    if metadata is not None:
        problems += _differing(metadata, sources, is_whole=is_whole and not further)
    sources[0].problems[:0] = problems
    return sources


def _opened(
    paths: Iterable[str],
    open_file: Callable[[str, Room], Source],
    metadata: Metadata | None,
    problems: list[Problem],
    room: Room,
) -> Iterator[Source]:
    """Open files, and add those that cannot be read to `problems`. `room` is for the contents of all."""
    is_by_sample = metadata is not None and metadata.is_by_sample
    for path in paths:
        try:
            source = open_compressed(path, open_file, room, is_by_sample=is_by_sample)
        except RecordingError as error:
            count = metadata.counts.get(os.path.basename(path), 0) if metadata else 0
            problems.append(Problem(f"a file is left out: {error}", samples=count))
            continue
        if not FORMATS[source.kind].storage:  # its times are of another clock
            source.close()
            problems.append(
                Problem(f"a file is left out: {path} is {FORMATS[source.kind].noun}, which is a recording of its own")
            )
        else:
            yield source


def _is_complete(metadata: Metadata, sources: Sequence[Source]) -> bool:
    """Whether the files have as many messages as metadata.yaml says: a recorder that crashed has written others."""
    counts = [_count_of(source) for source in sources]
    return bool(sources) and None not in counts and sum(count or 0 for count in counts) == metadata.total


def _check_one(folder: str, names: Sequence[str]) -> None:
    """Raise RecordingError if a folder that is no recording of rosbag2 has several files: each is a recording."""
    if len({*map(unpacked, names)}) > 1:
        shown = few([repr(name) for name in sorted(names)])
        own = os.path.basename(os.path.abspath(folder))
        raise RecordingError(
            f"{folder} has several recordings and no {METADATA}: name one of {shown}; "
            f"`msggen log convert {folder}` converts all. Files of one recording are called '{own}_0{MCAP}' and so on"
        )


def open_compressed(
    path: str, open_file: Callable[[str, Room], Source], folder_room: Room | None = None, *, is_by_sample: bool = False
) -> Source:
    """Return a file, which can be compressed, and so can its samples. Raises RecordingError, and OSError.

    Samples are decompressed if `is_by_sample`, or if they are zstd frames. `folder_room` is for all files of a folder.
    """
    room = Room(os.path.getsize(path), folder_room)
    with open(path, "rb") as file:
        is_compressed = file.read(len(ZSTD)) == ZSTD
    if not is_compressed:
        return PackedFile(open_file(path, room), path, room, is_by_sample=is_by_sample)
    folder = tempfile.TemporaryDirectory(prefix="msggen-", ignore_cleanup_errors=True)
    try:
        target = os.path.join(folder.name, unpacked(os.path.basename(path)))
        cut = decompress_file(path, target, room)
        source = open_file(target, room)
    except RecordingError as error:
        folder.cleanup()
        raise RecordingError(str(error).replace(target, path)) from None
    except CompressionError as error:
        folder.cleanup()
        raise RecordingError(f"{path} cannot be decompressed: {error}") from None
    except BaseException:
        folder.cleanup()
        raise
    if cut:
        source.problems.insert(0, Problem(f"the compressed file is damaged or cut off: {cut}"))
    return PackedFile(source, path, room, folder, is_by_sample=is_by_sample)


class PackedFile:
    """A file that was decompressed to a folder if there is one, and whose samples are decompressed as they are read."""

    def __init__(
        self,
        source: Source,
        path: str,
        room: Room,
        folder: tempfile.TemporaryDirectory[str] | None = None,
        *,
        is_by_sample: bool = False,
    ) -> None:
        self.path = path
        self.kind = source.kind
        self.problems = source.problems
        self.notes = source.notes
        self._source = source
        self._folder = folder
        self._is_by_sample = is_by_sample
        """Whether samples are compressed, as far as it is known yet."""
        self._room = room
        self._taken: Counter[int] = Counter()
        """The bytes that the samples of each channel have taken of the room. Reading them again takes nothing."""
        self._lost: set[tuple[int, int]] = set()
        """The channels and the log times of samples that cannot be decompressed, which are counted once."""
        self._places: dict[str, int] = {}
        """Where the problem with them is among all, by topic: a folder can have one for each name in metadata.yaml."""

    @property
    def channels(self) -> Mapping[int, Channel]:
        """The channels by their numbers."""
        return self._source.channels

    @property
    def facts(self) -> Facts:
        """What the file has."""
        return self._source.facts

    @property
    def information(self) -> Mapping[str, object]:
        """See Source.information."""
        return self._source.information

    @property
    def span(self) -> tuple[int, int] | None:
        """The first and the last log time in ns, or None without samples."""
        return self._source.span

    @property
    def message_count(self) -> int | None:
        """The number of messages, None if the file does not tell."""
        known: int | None = getattr(self._source, "message_count", None)
        return known

    def parts(self, channels: Collection[int], start: int = 0, stop: int = FOREVER) -> Iterator[Part]:
        """See Source.parts."""
        used: Counter[int] = Counter()
        for part in self._source.parts(channels, start, stop):
            is_cdr = self.channels[part.channel].encoding == "cdr"  # others may be frames of their own
            self._is_by_sample = self._is_by_sample or (is_cdr and _begins_with_frame(part))
            if self._is_by_sample and is_cdr:
                yield from self._unpacked(part, used)
            else:
                yield part

    def times(self, channels: Collection[int]) -> Mapping[int, NDArray[np.int64]]:
        """See Source.times."""
        return self._source.times(channels)

    @property
    def missing_checksums(self) -> int | None:
        """See Source.missing_checksums."""
        return self._source.missing_checksums

    def verify(self) -> Checksums:
        """See Source.verify."""
        return self._source.verify()

    def attached(self) -> Iterator[Attached]:
        """See Source.attached."""
        return self._source.attached()

    def close(self) -> None:
        """Close the file, and remove its decompressed copy. Can be repeated."""
        self._source.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _unpacked(self, part: Part, used: Counter[int]) -> Iterator[Part]:
        """Yield the samples of a part without compression. `used` counts the bytes of this reading by channel.

        Those without a frame of zstd stay as they are.
        """
        data = part.buffer.data
        kept: list[int] = []
        samples: list[bytes] = []
        size = spent = 0
        room = self._room_for(part.channel, used)
        for index, (start, length) in enumerate(zip(part.starts.tolist(), part.sizes.tolist(), strict=True)):
            sample = bytes(data[start : start + length])
            if sample.startswith(ZSTD):
                try:
                    sample = decompress_frame(sample, min(room - spent, LARGEST))
                    spent += len(sample)
                except CompressionError as error:
                    spent += error.spent
                    self._leave_out(part.channel, int(part.log_times[index]), str(error))
                    continue
            kept.append(index)
            samples.append(sample)
            size += len(sample)
            if size >= _BATCH:
                self._take(part.channel, spent, used)
                yield _part_of(part, kept, samples)
                kept, samples, size, spent = [], [], 0, 0
                room = self._room_for(part.channel, used)
        self._take(part.channel, spent, used)
        if kept:
            yield _part_of(part, kept, samples)

    def _room_for(self, number: int, used: Counter[int]) -> int:
        """Return how many bytes the next samples of a channel may have."""
        return self._room.left + max(self._taken[number] - used[number], 0)

    def _take(self, number: int, size: int, used: Counter[int]) -> None:
        """Take samples of a channel from the room, as far as no reading before has taken them."""
        used[number] += size
        self._room.take(max(used[number] - self._taken[number], 0))
        self._taken[number] = max(used[number], self._taken[number])

    def _leave_out(self, number: int, time: int, text: str) -> None:
        """Count a sample that cannot be decompressed."""
        if (number, time) in self._lost:
            return
        self._lost.add((number, time))
        topic = self.channels[number].topic
        place = self._places.setdefault(topic, len(self.problems))
        if place == len(self.problems):
            self.problems.append(Problem(f"samples that cannot be decompressed: {text}", topic=topic))
        problem = self.problems[place]
        self.problems[place] = problem._replace(samples=problem.samples + 1)


def _part_of(part: Part, kept: list[int], samples: list[bytes]) -> Part:
    chosen = np.array(kept, np.intp)
    sizes = np.fromiter(map(len, samples), np.int64, len(samples))
    published = None if part.publish_times is None else part.publish_times[chosen]
    buffer = np.frombuffer(b"".join(samples), np.uint8)
    return Part(part.channel, buffer, np.cumsum(sizes) - sizes, sizes, part.log_times[chosen], published)


def _begins_with_frame(part: Part) -> bool:
    """Whether the first sample of a part is a frame of zstd, which cannot be the beginning of CDR."""
    start, size = int(part.starts[0]), int(part.sizes[0])
    return size >= len(ZSTD) and bytes(part.buffer.data[start : start + len(ZSTD)]) == ZSTD


# metadata.yaml


def _metadata_of(folder: str, problems: list[Problem]) -> Metadata | None:
    """Read a metadata.yaml, None if there is none that can be read. Raises RecordingError for a foreign format."""
    path = os.path.join(folder, METADATA)
    try:
        found = _read_metadata(read_bytes(path))
    except FileNotFoundError:
        problems.append(Problem(f"{METADATA} is missing: the files are read in the order of their names"))
        return None
    except RecordingError:
        raise
    except OSError as error:
        problems.append(Problem(f"{METADATA} cannot be read: {error.strerror}"))
        return None
    except ValueError as error:
        problems.append(Problem(f"{METADATA} cannot be read: {error}"))
        return None
    problems += [Problem(text) for text in found.problems]
    return found


def _read_metadata(text: bytes) -> Metadata:
    """Return what a metadata.yaml says. Raises ValueError, and RecordingError for a storage that is not known."""
    from msggen.definitions.parse.yaml_nodes import read_yaml, value_of

    try:
        root = read_yaml(text, METADATA)
    except InputError as error:
        raise ValueError(error.diagnostics[0].message) from None
    document = None if root is None else value_of(root)
    content: Any = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    if not isinstance(content, dict):
        raise ValueError("it has no 'rosbag2_bagfile_information'")  # noqa: TRY004 - of the content
    storage = _word(content.get("storage_identifier", ""))
    if storage and storage not in _STORAGES:
        raise RecordingError(f"{METADATA}: the storage {storage!r} is not known, expected {either([*_STORAGES])}")
    mode, format_ = (_word(content.get(f"compression_{each}") or "").lower() for each in ("mode", "format"))
    if mode not in ("", "none") and format_ not in ("", "zstd"):
        raise RecordingError(f"{METADATA}: the compression {format_!r} is not known, expected zstd")
    paths = content.get("relative_file_paths")
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        raise ValueError("it has no list 'relative_file_paths'")
    version = content.get("version")
    is_known = isinstance(version, int) and 1 <= version <= _NEWEST
    if isinstance(version, int) and version < _WITH_FOLDER:
        paths = [path.partition("/")[2] if "/" in path and not os.path.isabs(path) else path for path in paths]
    count = content.get("message_count")
    return Metadata(
        list(dict.fromkeys(paths)),
        dict(_counts_in(content.get("files"))),
        count if _is_count(count) else None,
        mode == "message",
        () if is_known else (f"{METADATA} has version {_word(version)}: 1 to {_NEWEST} are known",),
    )


def _word(value: object) -> str:
    """Return a scalar as text. The text of others could be much longer than what they were read of."""
    return str(value) if isinstance(value, (str, int, float)) else type(value).__name__


def _counts_in(files: object) -> Iterator[tuple[str, int]]:
    for each in files if isinstance(files, list) else ():
        path, count = (each.get("path"), each.get("message_count")) if isinstance(each, dict) else (None, None)
        if isinstance(path, str) and _is_count(count):
            yield os.path.basename(path), count


def _is_count(value: object) -> TypeGuard[int]:
    """Whether a value is a number of messages."""
    return type(value) is int and 0 <= value < _LARGEST_COUNT


def _differing(metadata: Metadata, sources: Sequence[Source], *, is_whole: bool) -> Iterator[Problem]:
    """Yield where files have other numbers of messages than metadata.yaml says: it is older, or they are damaged."""
    total = 0
    for source in sources:
        name, count = os.path.basename(source.path), _count_of(source)
        if count is None:
            return
        total += count
        expected = metadata.counts.get(name)
        if expected is not None and expected != count:
            lost = max(expected - count, 0)
            yield Problem(f"{name} has {count} messages, {METADATA} says {expected}", samples=lost)
            is_whole = False  # the sum would say the same again
    if is_whole and metadata.total is not None and metadata.total != total:
        lost = max(metadata.total - total, 0)
        yield Problem(f"the files have {total} messages, {METADATA} says {metadata.total}", samples=lost)


def _count_of(source: Source) -> int | None:
    """Return the number of messages of a file, None if only reading all of it would show it."""
    known: int | None = getattr(source, "message_count", None)
    if known is not None:
        return known
    counts = [channel.sample_count for channel in source.channels.values()]
    return None if None in counts else sum(count or 0 for count in counts)


# files


def _chosen(folder: str, metadata: Metadata | None, names: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    """Return the paths of the files in order, the names of those that are missing, and the paths of further files.

    Without metadata.yaml, all are further files. A file and its compressed form are one file: rosbag2 decompresses a
    file beside it to play it.
    """
    found: dict[str, str] = {}
    missing = []
    for name in metadata.paths if metadata else ():
        path = _place_of(folder, name)
        if path is None:
            missing.append(name)
        else:
            found.setdefault(unpacked(os.path.basename(path)), path)
    further: dict[str, str] = {}
    for name in names:
        plain = unpacked(name)
        if plain not in found:
            further.setdefault(plain, os.path.join(folder, name))
    return list(found.values()), missing, list(further.values())


def _place_of(folder: str, name: str) -> str | None:
    """Return the path of a file that metadata.yaml names, with or without compression, None if there is none."""
    plain = unpacked(name)
    for each in (name, plain, *(plain + suffix for suffix in PACKED)):
        for below in (each, ntpath.basename(each)):  # which knows the separators of all systems
            path = os.path.join(folder, below)
            if _is_below(folder, below) and os.path.isfile(path):
                return path
    return None


def _is_below(folder: str, name: str) -> bool:
    """Whether a path leads to a place below a folder, on all systems. A file there can be a link: archives have some.

    Links to folders are not followed, as in a search for recordings.
    """
    *parents, _ = parts = re.split(r"[/\\]", name)
    is_relative = not name.startswith(("/", "\\")) and not ntpath.splitdrive(name)[0] and os.pardir not in parts
    return is_relative and not (parents and link_in(folder, "/".join(parents)))


def _in_order(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them: `flight_10.db3` after `flight_9.db3`."""
    return [(int(digits or -1), text) for text, digits in re.findall(r"(\D*)(\d*)", name)]
