"""Recordings of rosbag2: a folder with files, and the metadata.yaml that tells which."""

from __future__ import annotations

import ntpath
import os
import re
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from msggen.base.diagnostics import InputError, either, few
from msggen.base.disk.output import link_in
from msggen.base.disk.reading import read_bytes
from msggen.base.recording_formats import FORMATS, MCAP, PACKED, format_named, unpacked
from msggen.recordings.files.compression import Room
from msggen.recordings.files.paths import METADATA, is_always_whole, is_bag
from msggen.recordings.source.source import Problem, RecordingError, Source

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    Open = Callable[..., Source]
    """Opens a file, which can be compressed, with the room of all files of its folder."""

STORAGES = {each.storage: f"*{each.suffix}" for each in FORMATS.values() if each.storage}
"""The files of each storage."""
_NEWEST = 9
"""The newest version of metadata.yaml that is known."""
_WITH_FOLDER = 4
"""Before this version, the paths of files begin with the name of the folder."""
_LARGEST_COUNT = 1 << 63


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


def metadata_of(folder: str, problems: list[Problem]) -> Metadata | None:
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
    storage = _word(content.get("storage_identifier") or "")
    if storage and storage not in STORAGES:
        raise RecordingError(f"{METADATA}: the storage {storage!r} is not known, expected {either([*STORAGES])}")
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


def open_folder(path: str, open_file: Open) -> list[Source]:
    """Return the files of a recording of rosbag2 in their order. `open_file` opens one.

    What is wrong with the folder is among the problems of the first file. Raises RecordingError, and OSError.
    """
    recordings = sorted(filter(format_named, os.listdir(path)))
    found = [name for name in recordings if not is_always_whole(name)]
    names = [name for name in found if os.path.isfile(os.path.join(path, name))]
    others = sorted({*found} - {*names})
    problems = [Problem(f"{name} is left out: this is not a file") for name in others]
    if not is_bag(path):
        _check_one(path, [*names, *filter(is_always_whole, recordings)])
    metadata = metadata_of(path, problems)
    named, missing, further = _chosen(path, metadata, sorted(names, key=_in_order))
    for name in missing:
        count = metadata.counts.get(os.path.basename(name), 0) if metadata else 0
        wrong = "is missing" if _is_below(path, name) else "is not in the folder of the recording, and is not read"
        problems.append(Problem(f"{name}, which {METADATA} names, {wrong}", samples=count))
    if not named and not further:
        raise _without_files(path, problems)
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


def _without_files(folder: str, problems: Sequence[Problem]) -> RecordingError:
    """Return the error for a folder in which there is no file to open."""
    if not os.path.lexists(os.path.join(folder, METADATA)):
        text = f"a folder without {METADATA}, {' and '.join(STORAGES.values())}"
    else:
        found = "; ".join(problem.text for problem in problems)
        text = f"{found}, and there is no file {either(sorted(STORAGES.values()))}"
    return RecordingError(f"{folder} is not a recording: {text}")


def _opened(
    paths: Iterable[str],
    open_file: Open,
    metadata: Metadata | None,
    problems: list[Problem],
    room: Room,
) -> Iterator[Source]:
    """Open files, and add those that cannot be read to `problems`. `room` is for the contents of all."""
    is_by_sample = metadata is not None and metadata.is_by_sample
    for path in paths:
        try:
            source = open_file(path, room, is_by_sample=is_by_sample)
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
    counts = [source.message_count for source in sources]
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


def _differing(metadata: Metadata, sources: Sequence[Source], *, is_whole: bool) -> Iterator[Problem]:
    """Yield where files have other numbers of messages than metadata.yaml says: it is older, or they are damaged."""
    total = 0
    for source in sources:
        name, count = os.path.basename(source.path), source.message_count
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


# the files of a folder


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
