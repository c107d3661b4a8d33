"""The metadata.yaml that rosbag2 writes into the folder of a recording."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from msggen.base.diagnostics import InputError, either
from msggen.base.disk.reading import read_bytes
from msggen.base.recording_formats import FORMATS
from msggen.recordings.files.paths import METADATA
from msggen.recordings.source.source import Problem, RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

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
