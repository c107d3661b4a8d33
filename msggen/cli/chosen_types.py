"""The types of commands for vehicles: those that the options name, or else those of the current folder."""

from __future__ import annotations

import argparse
import os
import sys
from types import ModuleType
from typing import NamedTuple

from msggen.base.diagnostics import InputError, input_error
from msggen.cli.packages import import_package, topics_of
from msggen.cli.source_options import is_named, settings_of, sources_of
from msggen.generate.cache import package_from, package_of
from msggen.sources.embedded import EMBEDDED
from msggen.sources.finding import Sources, find_sources
from msggen.sources.settings import Settings


class Types(NamedTuple):
    """A generated package with the messages of a vehicle, and its name for people."""

    package: ModuleType
    label: str


def is_given(options: argparse.Namespace) -> bool:
    """Whether the options name types."""
    return bool(options.px4 or options.types)


def given_types(options: argparse.Namespace) -> Types | None:
    """Return the types that the options name, or None. Raises InputError if they cannot be used."""
    if options.px4:
        return _with_topics(Types(package_from(find_sources(options.px4)), options.px4))
    return _with_topics(Types(import_package(options.types), options.types)) if options.types else None


def folder_types(options: argparse.Namespace, *, is_needed: bool = False) -> Types | None:
    """Return the types of the current folder: its setting `types`, or else the firmware that `build` reads there.

    Returns None if it names none, and with a warning if a tree in it cannot be read, unless `is_needed`. Raises
    InputError if the types of the settings cannot be used.
    """
    settings = settings_of(options)
    if settings.types:
        package = import_package(settings.types, os.path.dirname(settings.origin))
        return _with_topics(Types(package, settings.types))
    try:
        sources = folder_sources(settings)
        if sources is None:
            return None
        found = Types(package_from(sources), sources.label)
    except InputError as error:
        if is_needed or settings.px4 or settings.msg_dir:
            raise
        print(f"warning: the current folder is not used: {error.diagnostics[0]}", file=sys.stderr)
        return None
    if _has_topics(found.package):
        return found
    if is_needed:
        text = "has no topics of the bridge, because it has no dds_topics.yaml: name one with the setting topics"
        print(f"warning: {found.label} {text}", file=sys.stderr)
    return None


def folder_sources(settings: Settings) -> Sources | None:
    """Return the firmware that `build` reads in the current folder, or None if it is an embedded release by default.

    Raises InputError.
    """
    none = dict.fromkeys(("px4", "msg_dir", "topics", "release", "board"))
    options = argparse.Namespace(**none, strict=False)
    return sources_of(options, settings, packages=False) if is_named(options, settings) else None


def known_types(options: argparse.Namespace) -> Types | None:
    """Return the types that the options or else the current folder name, or None. Raises InputError.

    They are read once for the options.
    """
    if "known_types" not in options:
        options.known_types = given_types(options) or folder_types(options)
    found: Types | None = options.known_types
    return found


def expected_types(options: argparse.Namespace) -> Types:
    """Return the types of a vehicle before it has connected: the known ones, or those of the newest release.

    Raises InputError.
    """
    return known_types(options) or release_types(EMBEDDED[0])


def release_types(release: str) -> Types:
    """Return the types of an embedded release."""
    return Types(package_of(release), release)


def _with_topics(types: Types) -> Types:
    """Return types that have topics. Raises InputError for others."""
    if not _has_topics(types.package):
        raise input_error(types.label, "L103", "no topics of the bridge: no dds_topics.yaml", 0)
    return types


def _has_topics(package: ModuleType) -> bool:
    return bool(getattr(topics_of(package), "ENDPOINTS", ()))
