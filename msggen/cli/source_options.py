"""The sources of a command, named by its options or by the settings."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from msggen.base.diagnostics import Diagnostic, InputError, input_error
from msggen.base.location import Location
from msggen.base.recording_formats import format_named
from msggen.cli.printing import print_notices
from msggen.sources.embedded import names_release, near_release, unknown_release
from msggen.sources.file import BoardOption
from msggen.sources.finding import Sources, find_sources, split_package, with_board
from msggen.sources.installed import names_installed, wrong_installed
from msggen.sources.settings import Settings, read_settings
from msggen.sources.tree import Folder
from msggen.sources.tree_layout import find_manifest, is_firmware, tree_above, whole_tree

if TYPE_CHECKING:
    from msggen.recordings import Log


def settings_of(options: argparse.Namespace) -> Settings:
    """Return the settings for the current folder. The first call prints a note about those that are not read."""
    if "settings" not in options:
        options.settings = read_settings(os.curdir)
        print_notices(options.settings.notices)
    found: Settings = options.settings
    return found


def sources_of(options: argparse.Namespace, settings: Settings, *, packages: bool = True) -> Sources:
    """Return the sources that the options or else the settings name.

    By default, these are the tree or, with `packages`, the ROS package in the current folder, or else the newest
    embedded release. Raises InputError for paths that do not exist. A path in the settings is reported with the
    location of its setting.
    """
    errors = [*_missing(options, settings)]
    if errors:
        raise InputError(errors)
    px4 = options.px4 or settings.px4
    folders = tuple(options.msg_dir or settings.msg_dir)
    here = None if px4 or folders else source_here(packages=packages)
    if px4 and is_recording(px4):
        return recorded(options, px4)._replace(strict=is_strict(options, settings))
    found = find_sources(
        px4 or here,
        folders,
        options.topics or settings.topics,
        options.release or settings.release,
        settings.place("release") if options.release is None else Location("--release", 0),
    )
    if here:
        name = "PX4-Autopilot tree" if found.is_tree else f"package {found.package}"
        found = found._replace(label=f"the {name} in the current folder")
    elif found.embedded and not is_named(options, settings):
        found = found._replace(notices=(*found.notices, *_tree_above()))
    found = with_board(found, board_of(options, settings))
    return found._replace(strict=is_strict(options, settings))


def is_recording(path: str) -> bool:
    """Whether a path is named as recordings are: a file, or a folder of rosbag2."""
    if names_installed(path):
        return False
    if os.path.isdir(path):
        from msggen.recordings.files.paths import is_bag

        return os.access(path, os.R_OK) and is_bag(path)
    return format_named(path) is not None and os.path.isfile(path)


def recorded(options: argparse.Namespace, path: str, other: Sources | None = None) -> Sources:
    """Return the definitions of a recording, which are compared with those of `other`. Raises InputError."""
    from msggen.cli.commands.log.opening import opened

    with opened(options, path) as log:
        from msggen.recordings.definitions.of_recordings import sources_of

        damage = tuple(_damage(log))
        try:
            found = sources_of(log.topics, log.path, other)
        except InputError as error:
            raise InputError(error.diagnostics, (*error.notices, *damage)) from None
        return found._replace(notices=(*damage, *found.notices))


def _damage(log: Log) -> Iterator[Diagnostic]:
    """Yield a warning if the recording is damaged, as far as that is known before its samples are read."""
    from msggen.cli.commands.log.opening import problem_text

    damaged = [each for each in log.problems if not each.topic]
    if damaged:
        more = f", and {len(damaged) - 1} more, which `msggen log info` lists" if len(damaged) > 1 else ""
        text = (
            f"a part of the recording cannot be read, and may have other definitions: {problem_text(damaged[0])}{more}"
        )
        yield Diagnostic(Location(log.path, 0), "R142", text)


def generated(options: argparse.Namespace, folder: str, recording: str) -> Sources:
    """Return the definitions of a generated package for the types of a recording. Raises InputError."""
    from msggen.cli.commands.log.opening import opened
    from msggen.cli.packages import import_package

    package = import_package(os.path.abspath(folder))
    with opened(options, recording) as log:
        from msggen.recordings.definitions.of_recordings import sources_of_package

        return sources_of_package(package, log.topics)


def is_named(options: argparse.Namespace, settings: Settings) -> bool:
    """Whether the options, the settings or the current folder name the firmware."""
    given = options.px4 or options.msg_dir or settings.px4 or settings.msg_dir
    return bool(given or source_here(packages=False))


def source_here(*, packages: bool = True) -> str | None:
    """Return the current folder if it is in a PX4-Autopilot tree or, with `packages`, in a ROS package of messages.

    Of a tree, this is also the folder of its messages, which `find_sources` refuses with the folder that is meant.
    """
    folder = Folder(os.curdir)
    if whole_tree(os.curdir) or is_firmware(folder):
        return os.curdir
    return os.curdir if packages and folder.is_folder("msg") and find_manifest(folder) else None


def _tree_above() -> Iterator[Diagnostic]:
    """Yield a warning if the current folder is below a PX4-Autopilot tree, which is not read."""
    tree = tree_above(os.curdir)
    if tree:
        text = f"in a PX4-Autopilot tree, but the embedded release is read: did you mean --px4 {tree}?"
        yield Diagnostic(Location(os.curdir, 0), "S127", text)


def firmware_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources as `sources_of` does. Also raises InputError if none of them has messages of uORB."""
    sources = sources_of(options, settings, packages=False)
    if not sources.has_own:
        place = Location("--msg-dir", 0) if options.msg_dir else settings.place("msg-dir")
        text = "no definitions of the firmware, only of other packages: name the firmware with --px4 or the setting px4"
        raise input_error(place.path, "S102", text, *place[1:])
    return sources


def board_of(options: argparse.Namespace, settings: Settings, *, optional: bool = False) -> BoardOption | None:
    """Return the board that the options or else the settings name, or None for a command without `--board`."""
    if "board" not in options:
        return None
    if options.board:
        return BoardOption(options.board, optional=optional)
    return BoardOption(settings.board, settings.place("board"), optional) if settings.board else None


def is_strict(options: argparse.Namespace, settings: Settings) -> bool:
    """Whether warnings are errors."""
    strict: bool | None = options.strict
    return bool(settings.strict) if strict is None else strict


def shell_options(given: Mapping[str, str | Sequence[str] | None]) -> str:
    """Return options and their values for a shell, with a space before each. Options without a value are left out."""
    pairs = [
        (name, each)
        for name, values in given.items()
        for each in ([values] if isinstance(values, str) else values or ())
    ]
    if not pairs:
        return ""
    from shlex import quote

    return "".join(f" {name} {quote(value)}" for name, value in pairs)


def firmware_path(options: argparse.Namespace, settings: Settings) -> str:
    """Return the firmware of a command that always has one, by default the current folder."""
    path: str = options.px4 or settings.px4 or os.curdir
    return path


def check_setting(options: argparse.Namespace, settings: Settings) -> None:
    """Raise InputError if the setting px4 is used and its path does not exist."""
    errors = [*_missing_folder(settings.px4, settings, "px4")] if settings.px4 and not options.px4 else ()
    if errors:
        raise InputError(errors)


def _missing(options: argparse.Namespace, settings: Settings) -> Iterator[Diagnostic]:
    """Yield an error for each path that does not exist.

    `breaking` copies the setting px4 into the option, so the values are compared to find the location.
    """
    for path in filter(None, [options.px4 or settings.px4]):
        yield from _missing_folder(path, settings, "px4" if path == settings.px4 else None)
    for text in options.msg_dir or settings.msg_dir:
        yield from _missing_folder(split_package(text)[1], settings, None if options.msg_dir else "msg-dir")
    path = settings.topics
    if path and not options.topics and not os.path.exists(path):
        from msggen.base.disk.names import path_hint

        text = f"'{path}': no such file{path_hint(path, is_meant=os.path.exists)}"
        yield Diagnostic(settings.place("topics"), "S101", text)


def _missing_folder(path: str, settings: Settings, key: str | None) -> Iterator[Diagnostic]:
    """Yield an error if `path` is neither a path nor a revision of a folder. `key` is its setting, or None."""
    if names_installed(path):
        yield from _wrong_name(path, "S132", wrong_installed(path), settings, key)
        return
    if os.path.exists(path):
        return
    if names_release(path):
        yield from _wrong_name(path, "S105", unknown_release(path), settings, key)
        return
    from msggen.base.disk.names import path_hint
    from msggen.sources.revision import split_revision

    if split_revision(path)[1]:
        return
    folder = path.partition("@")[0] or path
    hint = near_release(os.path.basename(path) if key else path) or path_hint(folder)
    if key:
        yield Diagnostic(settings.place(key), "S101", f"'{folder}': no such folder{hint}")
    else:
        yield Diagnostic(Location(folder, 0), "S101", f"no such folder{hint}")


def _wrong_name(name: str, code: str, wrong: str, settings: Settings, key: str | None) -> Iterator[Diagnostic]:
    """Yield an error if something is `wrong` with a name, at its setting `key` if that is not None."""
    if wrong and key:
        yield Diagnostic(settings.place(key), code, f"'{name}': {wrong}")
    elif wrong:
        yield Diagnostic(Location(name, 0), code, wrong)
