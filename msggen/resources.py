"""What the tool brings along: in the installed package, or in the checkout it runs from."""

from __future__ import annotations

import os

_PACKAGE = os.path.dirname(os.path.abspath(__file__))


def resource(name: str) -> str:
    """Return the path of the folder `name`, such as "templates"."""
    installed = os.path.join(_PACKAGE, name)
    return installed if os.path.isdir(installed) else os.path.join(os.path.dirname(_PACKAGE), name)
