"""Packages that a command needs: generated ones that an option names, and those of an extra."""

from __future__ import annotations

import os
import sys
from types import ModuleType

from msggen.diagnostics import InputError, input_error


def import_package(text: str) -> ModuleType:
    """Import a generated package by its name or by its folder. Raises InputError if it cannot be imported."""
    from importlib import import_module

    path = os.path.abspath(text)
    folder, name = os.path.split(path) if os.path.isdir(path) else (os.curdir, text)
    sys.path.insert(0, os.path.abspath(folder))
    try:
        return import_module(name)
    except Exception as error:  # noqa: BLE001 - the code of the user
        raise input_error(text, "L103", f"cannot be imported: {error}", 0) from None
    finally:
        sys.path.pop(0)


def topics_of(package: ModuleType) -> ModuleType:
    """Return the module `topics` of a generated package. Raises InputError for another package."""
    from importlib import import_module

    try:
        return import_module(f"{package.__name__}.topics")
    except ImportError:
        raise input_error(package.__name__, "L103", "not a package that msggen has generated", 0) from None


def missing_extra(error: ImportError, extra: str, code: str) -> InputError:
    """Return the error about a package that comes with an extra of msggen, and is not installed."""
    return input_error(str(error.name), code, f"this package is not installed: pip install 'msggen[{extra}]'", 0)
