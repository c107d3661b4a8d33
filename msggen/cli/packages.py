"""Packages that a command needs: generated ones that an option names, and those of an extra for recordings and stores.

Errors of recordings and of stores are as commands print them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import TYPE_CHECKING

from msggen.base.diagnostics import InputError, input_error
from msggen.base.missing import installing
from msggen.sources.settings import names_folder

if TYPE_CHECKING:
    from msggen.recordings.stores.errors import StoreError


def import_package(text: str, base: str = "") -> ModuleType:
    """Import a generated package: the folder of a path such as `./NAME`, or an installed one by its name.

    `base` is the folder that the name is from, and never imported from. Raises InputError if it cannot be imported.
    """
    try:
        return _import_folder(text) if names_folder(text) else _import_installed(text)
    except Exception as error:  # noqa: BLE001 - the code of the user
        is_meant = not names_folder(text) and os.path.isdir(os.path.join(base, text))
        hint = f"; to use the folder, write .{os.sep}{text}" if is_meant else ""
        raise input_error(text, "L103", f"cannot be imported: {error}{hint}", 0) from None


def _import_folder(path: str) -> ModuleType:
    """Import the package in a folder. No other module is imported from where the folder is."""
    path = os.path.abspath(path)
    name = os.path.basename(path)
    found = sys.modules.get(name)
    if found is not None:
        if os.path.realpath(os.path.dirname(found.__file__ or os.devnull)) == os.path.realpath(path):
            return found
        if not hasattr(found, "by_type"):
            raise ImportError(f"'{name}' is the name of another module: rename the folder")
    from msggen.generate.cache import import_folder

    return import_folder(name, path)


def _import_installed(name: str) -> ModuleType:
    """Import a package from anywhere but a relative folder, as the current one is for `python -c`."""
    from importlib import import_module

    before = sys.path[:]
    sys.path[:] = filter(os.path.isabs, before)
    try:
        return import_module(name)
    finally:
        sys.path[:] = before


def topics_of(package: ModuleType) -> ModuleType:
    """Return the module `topics` of a generated package. Raises InputError for another package."""
    from importlib import import_module

    with suppress(ImportError):
        topics = import_module(f"{package.__name__}.topics")
        if hasattr(package, "by_type"):
            return topics
    raise input_error(package.__name__, "L103", "not a package that msggen has generated", 0)


@contextmanager
def needing(extra: str, code: str) -> Iterator[None]:
    """Raise an InputError if a package that comes with an extra of msggen is missing in the block."""
    try:
        yield
    except ImportError as error:
        raise missing_extra(error, extra, code) from None


def check_reading(code: str, extra: str = "recordings") -> None:
    """Raise an InputError if a package is missing that reads recordings."""
    with needing(extra, code):
        import numpy  # noqa: F401, ICN001
        import zstandard  # noqa: F401


def missing_extra(error: ImportError, extra: str, code: str) -> InputError:
    """Return the error about a package that comes with an extra of msggen, and is not installed."""
    name = str(error.name).partition(".")[0]
    return input_error(name, code, f"this package is not installed: {installing(extra)}", 0)


@contextmanager
def read_errors(path: str) -> Iterator[None]:
    """Raise InputError for a recording that cannot be read."""
    from msggen.recordings.source.source import RecordingError

    try:
        yield
    except RecordingError as error:
        raise input_error(path, "R102", str(error).removeprefix(f"{path} "), 0) from None
    except OSError as error:
        raise input_error(path, "R102", f"cannot be read: {error.strerror}", 0) from None


@contextmanager
def store_errors(code: str) -> Iterator[None]:
    """Raise InputError for an object in a store, and for a package for stores that is not installed."""
    from msggen.recordings.stores.errors import StoreError

    try:
        yield
    except StoreError as error:
        raise store_failed(error, code) from None
    except ModuleNotFoundError as error:
        raise missing_extra(error, "stores", code) from None


def store_failed(error: StoreError, code: str) -> InputError:
    """Return the error about an object in a store."""
    return input_error(str(error.filename), code, str(error.strerror), 0)
