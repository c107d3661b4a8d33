"""Packages that a command needs: generated ones that an option names, and those of an extra."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from types import ModuleType

from msggen.base.diagnostics import InputError, input_error
from msggen.base.missing import installing
from msggen.sources.settings import names_folder


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


def check_reading(code: str, extra: str = "recordings") -> None:
    """Raise an InputError if a package is missing that reads recordings."""
    try:
        import numpy  # noqa: F401, ICN001
        import zstandard  # noqa: F401
    except ImportError as error:
        raise missing_extra(error, extra, code) from None


def missing_extra(error: ImportError, extra: str, code: str) -> InputError:
    """Return the error about a package that comes with an extra of msggen, and is not installed."""
    name = str(error.name).partition(".")[0]
    return input_error(name, code, f"this package is not installed: {installing(extra)}", 0)
