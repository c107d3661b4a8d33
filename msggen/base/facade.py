"""The names that a package offers, each imported from its module on first use."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from importlib import import_module


def attribute(package: str, modules: Mapping[str, Iterable[str]], name: str, of: str = "") -> object:
    """Return the public name of a package, from the module of `modules` that has it. `__getattr__` calls it.

    The modules are in the package `of`, by default in the same one. A name can be a module of that module. Raises
    AttributeError for any other name.
    """
    for module, names in modules.items():
        if name in names:
            found = import_module(f"{of or package}.{module}")
            value = getattr(found, name) if hasattr(found, name) else import_module(f"{found.__name__}.{name}")
            return vars(sys.modules[package]).setdefault(name, value)
    text = f"module '{package}' has no attribute '{name}'"
    raise AttributeError(text, name=name, obj=sys.modules[package])  # Python suggests the nearest name


def names(package: str, modules: Mapping[str, Iterable[str]]) -> list[str]:
    """Return the names that are imported already, and the public names that can be imported. `__dir__` calls it."""
    return sorted({*vars(sys.modules[package]), *(name for own in modules.values() for name in own)})
