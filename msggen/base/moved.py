"""Modules that have moved, and still work under their old names, with a warning."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import warnings
from collections.abc import Mapping
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import MappingProxyType, ModuleType

MOVED: Mapping[str, str] = MappingProxyType(
    {
        "msggen.diagnostics": "msggen.base.diagnostics",
        "msggen.firmware.catalog": "msggen.sources.catalog",
        "msggen.firmware.sources": "msggen.sources.sources",
        "msggen.identity": "msggen.definitions.identity",
        "msggen.layout": "msggen.definitions.layout",
        "msggen.live.errors": "msggen.live.link",
        "msggen.live.meter": "msggen.live.vehicle.meter",
        "msggen.location": "msggen.base.location",
        "msggen.model": "msggen.definitions.model",
        "msggen.report.errors": "msggen.show.report.errors",
        "msggen.ros.plan": "msggen.live.ros.plan",
        "msggen.ros.refusals": "msggen.live.ros.refusals",
        "msggen.ros.relay": "msggen.live.ros.relay",
        "msggen.ros.standard": "msggen.live.ros.standard",
        "msggen.ros.types": "msggen.live.ros.types",
        "msggen.top.drawing": "msggen.show.top.drawing",
        "msggen.top.rows": "msggen.show.top.rows",
        "msggen.top.view": "msggen.show.top.view",
    }
)
"""Documented modules by their names before the rooms. Version 0.2 will not have the old names (CHANGELOG.md)."""

_FOLDERS = {name.rpartition(".")[0] for name in MOVED} - {"msggen", "msggen.live"}


def spec_of(name: str) -> ModuleSpec | None:
    """Return how to import a module under its old name, None if it has none. Its import warns."""
    if name in MOVED:
        text = f"{name} is {MOVED[name]} now, and its old name will be removed"
        warnings.warn(text, DeprecationWarning, stacklevel=3)
        return importlib.util.spec_from_loader(name, _Loader())
    return ModuleSpec(name, _Loader(), is_package=True) if name in _FOLDERS else None


class _Loader(Loader):
    """A loader that gives a module under its old name, or a folder that only has such modules."""

    def create_module(self, _: ModuleSpec) -> ModuleType | None:
        """Let Python make the module."""
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Put the module at its new place in the place of `module`."""
        if module.__name__ in MOVED:
            sys.modules[module.__name__] = importlib.import_module(MOVED[module.__name__])
