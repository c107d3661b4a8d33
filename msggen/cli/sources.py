"""The sources of a command, named by its options or by the settings."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator

from msggen.diagnostics import Diagnostic, InputError, input_error
from msggen.firmware.embedded import names_release, near_release, unknown_release
from msggen.firmware.file import BoardOption
from msggen.firmware.sources import Sources, find_sources, split_package, with_board
from msggen.location import Location
from msggen.settings import Settings


def sources_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources that the options or else the settings name, by default the newest embedded release.

    Raises InputError for paths that do not exist. A path in the settings is reported with the location of its setting.
    """
    errors = [*_missing(options, settings)]
    if errors:
        raise InputError(errors)
    found = find_sources(
        options.px4 or settings.px4,
        tuple(options.msg_dir or settings.msg_dir),
        options.topics or settings.topics,
        options.release or settings.release,
        settings.place("release") if options.release is None else Location("--release", 0),
    )
    found = with_board(found, board_of(options, settings))
    return found._replace(strict=is_strict(options, settings))


def firmware_of(options: argparse.Namespace, settings: Settings) -> Sources:
    """Return the sources as `sources_of` does. Also raises InputError if none of them has messages of uORB."""
    sources = sources_of(options, settings)
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
        from msggen.firmware.path_hint import path_hint

        text = f"'{path}': no such file{path_hint(path, is_meant=os.path.exists)}"
        yield Diagnostic(settings.place("topics"), "S101", text)


def _missing_folder(path: str, settings: Settings, key: str | None) -> Iterator[Diagnostic]:
    """Yield an error if `path` is neither a path nor a revision of a folder. `key` is its setting, or None."""
    if os.path.exists(path):
        return
    if names_release(path):
        wrong = unknown_release(path)
        if wrong:
            yield Diagnostic(
                settings.place(key) if key else Location(path, 0), "S105", f"'{path}': {wrong}" if key else wrong
            )
        return
    from msggen.firmware.path_hint import path_hint
    from msggen.firmware.revision import split_revision

    if split_revision(path)[1]:
        return
    folder = path.partition("@")[0] or path
    hint = near_release(os.path.basename(path) if key else path) or path_hint(folder)
    if key:
        yield Diagnostic(settings.place(key), "S101", f"'{folder}': no such folder{hint}")
    else:
        yield Diagnostic(Location(folder, 0), "S101", f"no such folder{hint}")
