"""The modules of a generated package that are copied unchanged from `templates/python/support`."""

from __future__ import annotations

import os

from msggen.disk.resources import resource


def support_path(name: str) -> str:
    """Return the path of a support module."""
    return os.path.join(resource("templates"), "python", "support", name)


def support_text(name: str) -> str:
    """Return the source of a support module."""
    with open(support_path(name), encoding="utf-8") as stream:
        return stream.read()
