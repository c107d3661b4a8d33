"""The update of the files in a folder: only files that differ are written, and only files of msggen are replaced."""

import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import NamedTuple

from msggen.base.diagnostics import InputError, input_error
from msggen.base.disk.files import create_file
from msggen.base.disk.record import RECORD_NAME, Record, digest, digest_of, read_record, record_text, write_record
from msggen.base.disk.staging import (
    STAGE,
    check_writable,
    clear,
    locked,
    make_folder,
    stage_beside,
    staging_folder,
    written_aside,
)


class OutputPlan(NamedTuple):
    """The changes that a run makes in a folder.

    Obsolete files are `removed`, or `edited` by the user and kept, or `missing` already.
    """

    folder: str
    files: Mapping[str, str]
    written: tuple[str, ...]
    removed: tuple[str, ...]
    edited: tuple[str, ...]
    missing: tuple[str, ...] = ()

    @property
    def is_stale(self) -> bool:
        """Whether the plan writes or removes a file."""
        return bool(self.written or self.removed)

    @property
    def is_single(self) -> bool:
        """Whether the plan changes a single file, which is one step."""
        return len(self.written) + len(self.removed) == 1


def plan_output(folder: str, files: Mapping[str, str], record: Record) -> OutputPlan:
    """Return the changes that make `folder` contain `files`, texts by name.

    Raises InputError if a file to be replaced is not in `record`, or if `folder` or a folder in it to write to is a
    symbolic link.
    """
    check_links(folder, ["", *_parents(files)])
    stale = stale_files(folder, files)
    for name in stale:
        path = os.path.join(folder, name)
        if os.path.isdir(path) or (name not in record.files and os.path.lexists(path)):
            text = "msggen did not write this file and leaves it alone: move it, or choose another folder or package"
            raise input_error(path, "S104", text)
    found = {name: digest_of(folder, name) for name in _obsolete(folder, files, record)}
    removed = tuple(name for name, value in found.items() if value == record.files[name])
    edited = tuple(name for name, value in found.items() if value not in (None, record.files[name]))
    missing = tuple(name for name, value in found.items() if value is None)
    return OutputPlan(folder, files, stale, removed, edited, missing)


@contextmanager
def locked_output(folder: str) -> Iterator[None]:
    """Create the parent of `folder` and hold a lock on it: the folder itself may be replaced. Raises OSError."""
    check_links(folder, [""])  # before a folder is created
    parent = os.path.dirname(folder) or os.curdir
    if not os.path.isdir(parent):
        make_folder(parent)
    with locked(parent):
        yield


def write_output(folder: str, files: Mapping[str, str]) -> tuple[OutputPlan, Record]:
    """Write `files`, and remove the other files of earlier runs. Return the changes and the new record.

    If the system can, all changes are made in one step: after a kill, the folder is the old one or the new one.
    Otherwise each file is replaced in one step, and the next run recognises the files and finishes. The caller holds
    the lock of `locked_output`.

    Raises InputError as `plan_output`, or OSError if the folder cannot be written; nothing is changed then.
    """
    before = read_record(folder)
    plan = plan_output(folder, files, before)
    after = Record({name: digest(text.encode()) for name, text in files.items()})
    for stage in (stage_beside(folder), os.path.join(folder, STAGE)):
        clear(stage)
    if plan.is_stale:
        for parent in ("", *_parents((*plan.written, *plan.removed))):
            path = os.path.join(folder, parent)
            if os.path.isdir(path):
                check_writable(path)
        if plan.is_single or not _replace_folder(plan, after):
            _replace_files(plan, before, after)
    _remove_empty(folder, (*plan.removed, *plan.missing))
    write_record(folder, after)
    return plan, after


def stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the `files`, texts by name, that are missing in `folder` or differ there."""
    return tuple(name for name, text in files.items() if digest_of(folder, name) != digest(text.encode()))


def write_stale_files(folder: str, files: Mapping[str, str]) -> tuple[str, ...]:
    """Write the `files` that are missing in `folder` or differ there, and return their names.

    Files that msggen did not write are replaced too. All files are first written to a staging folder, then moved into
    place. Runs on the same folder wait for each other. Raises InputError if a folder to write to is a symbolic link, or
    OSError if the folder cannot be written; nothing is changed then.
    """
    check_links(folder, [""])  # before a folder is created
    if not os.path.isdir(folder):
        make_folder(folder)
    with locked(folder):
        check_links(folder, _parents(files))
        stale = stale_files(folder, files)
        if stale:
            encoded = _encoded(folder, files, stale)
            with written_aside(encoded, os.path.join(folder, STAGE), flushed=False) as move_into_place:
                move_into_place()
        else:
            clear(os.path.join(folder, STAGE))
        return stale


def _replace_folder(plan: OutputPlan, record: Record) -> bool:
    """Build the new folder next to the current one, and swap them. Return False if the system cannot do this."""
    from msggen.base.disk.swap import can_swap, flush_tree, keep_newer, mirror, swap_folders

    if not can_swap(plan.folder):
        return False
    written = {**_encoded("", plan.files, plan.written), RECORD_NAME: record_text(record).encode()}
    replaced = {*written, *plan.removed}
    is_done = False
    try:
        with staging_folder(stage_beside(plan.folder)) as content:
            built = os.path.join(content, os.path.basename(plan.folder))
            if os.path.isdir(plan.folder):
                mirror(plan.folder, built, replaced)
            for name, data in written.items():
                make_folder(os.path.dirname(os.path.join(built, name)))
                create_file(os.path.join(built, name), data)
            _remove_empty(built, plan.removed)
            flush_tree(built, written)
            is_done = not swap_folders({plan.folder: built})
            if is_done and os.path.isdir(built):
                keep_newer(built, plan.folder, replaced)
    except (InputError, OSError):  # a file in the place of a folder: `_replace_files` reports where it is
        if is_done:
            raise
    return is_done


def _replace_files(plan: OutputPlan, before: Record, after: Record) -> None:
    """Write the new files to a staging folder, then a record of old and new files, then move the files into place."""
    during = Record({**{name: before.files[name] for name in plan.removed}, **after.files})
    make_folder(plan.folder)
    files = _encoded(plan.folder, plan.files, plan.written)
    with written_aside(files, os.path.join(plan.folder, STAGE)) as move_into_place:
        write_record(plan.folder, during)
        move_into_place()
    for name in plan.removed:
        os.unlink(os.path.join(plan.folder, name))


def _encoded(folder: str, files: Mapping[str, str], names: Collection[str]) -> dict[str, bytes]:
    """Return the bytes of the files `names` by path."""
    return {os.path.join(folder, name): files[name].encode() for name in names}


def _obsolete(folder: str, files: Collection[str], record: Record) -> list[str]:
    """Return the names of recorded files that are not in `files`, except in folders that are symbolic links."""
    names = [name for name in record.files if name not in files]
    linked = {parent for parent in ("", *_parents(names)) if link_in(folder, parent)}
    return [name for name in names if os.path.dirname(name) not in linked]


def check_links(folder: str, parents: Collection[str]) -> None:
    """Raise InputError if one of `parents`, folders in `folder` or "" for itself, is a symbolic link or below one."""
    for parent in parents:
        link = link_in(folder, parent)
        if link:
            text = f"symbolic link to {os.readlink(link)}: replace it with a folder, or name its target as the output"
            raise input_error(link, "S115", text, 0)


def link_in(folder: str, parent: str) -> str:
    """Return the first symbolic link on the way from `folder` to `parent` in it, or "".

    An empty parent is `folder`: the way to it starts at the current folder, which may be a stranger's. An absolute path
    may lead through links, because the system has some.
    """
    if not parent and os.path.isabs(folder):
        return folder if os.path.islink(folder) else ""
    base, parts = (folder, parent.split("/")) if parent else ("", folder.split(os.sep))
    paths = (os.path.join(base, *parts[:end]) for end in range(1, len(parts) + 1))
    return next(filter(os.path.islink, paths), "")


def _remove_empty(folder: str, names: Collection[str]) -> None:
    """Remove the folders of the files `names` that are empty."""
    for parent in reversed(_parents(names)):  # inner folders first
        with suppress(OSError):
            os.rmdir(os.path.join(folder, parent))


def _parents(names: Collection[str]) -> list[str]:
    return sorted({os.path.dirname(name) for name in names} - {""})
