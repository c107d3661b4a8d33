"""The files that are part of msggen, in the installed package or in the checkout."""

from __future__ import annotations

import os

PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
"""The folder of msggen's modules."""


def checkout() -> str | None:
    """Return the folder of the checkout that msggen runs in, None for an installed copy."""
    return None if _root("templates") == PACKAGE else os.path.dirname(PACKAGE)


def resource(name: str) -> str:
    """Return the path of the folder `name`, such as "templates"."""
    return os.path.join(_root(name), name)


def template_text(name: str) -> str:
    """Return the text of a file in `templates/`. `name` has `/` between folders."""
    with open(template_path(name), encoding="utf-8") as stream:
        return stream.read()


def module_text(name: str) -> str:
    """Return the source of a module of msggen itself, such as "definitions/unit.py"."""
    with open(os.path.join(PACKAGE, *name.split("/")), encoding="utf-8") as stream:
        return stream.read()


def template_path(name: str) -> str:
    """Return the path of a file in `templates/`. `name` has `/` between folders."""
    return os.path.join(resource("templates"), *name.split("/"))


def embedded_root() -> str:
    """Return the folder of the newest embedded release. The others are in its `releases/`."""
    root = _root("embedded")
    return os.path.join(root, "embedded") if root == PACKAGE else root


def _root(name: str) -> str:
    """Return the folder of the installed package if it has `name`, else that of the checkout."""
    return PACKAGE if os.path.isdir(os.path.join(PACKAGE, name)) else os.path.dirname(PACKAGE)
