"""The firmware of the current folder, for definitions that a recording lacks."""

from __future__ import annotations

import argparse
import sys
from types import ModuleType

from msggen.base.diagnostics import InputError


def folder_firmware(options: argparse.Namespace) -> tuple[ModuleType, str] | None:
    """Return a package of the firmware in the current folder and its name, or None.

    The setting `types` is not used: `log` reads files of others, and imports no package of theirs.
    """
    from msggen.cli.chosen_types import folder_sources
    from msggen.cli.source_options import settings_of
    from msggen.generate.cache import package_from

    try:
        sources = folder_sources(settings_of(options))
        return None if sources is None else (package_from(sources), sources.label)
    except InputError as error:
        print(f"warning: the current folder is not used: {error.diagnostics[0]}", file=sys.stderr)
        return None
