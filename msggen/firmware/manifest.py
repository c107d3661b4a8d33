"""What a package.xml says: the name of the ROS package (REP 149)."""

from __future__ import annotations

import re

from msggen.diagnostics import fault


def package_name(data: bytes, path: str) -> str:
    """Return the name of the package that the package.xml in `data` describes. Raises InputError."""
    from xml.etree import ElementTree as ET

    try:
        name = ET.fromstring(data).findtext("name", "").strip()  # noqa: S314
    except ET.ParseError as error:
        line, column = error.position
        raise fault(path, "S107", f"not XML: {error}", line, column + 1) from None
    except (LookupError, ValueError) as error:  # an encoding that Python does not have
        raise fault(path, "S107", f"not XML: {error}", 0) from None
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise fault(path, "S107", f"'{name}' is no name of a ROS package", 0)
    return name
