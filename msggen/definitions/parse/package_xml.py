"""The parser of package.xml, which reads the name and the version of the ROS package (REP 149)."""

import re
from typing import NamedTuple

from msggen.base.diagnostics import input_error


class Manifest(NamedTuple):
    """What a package.xml tells. The version is "" if it is not three numbers."""

    name: str
    version: str


def package_name(data: bytes, path: str) -> str:
    """Return the name of the package in `data`, the bytes of a package.xml. Raises InputError."""
    return read_manifest(data, path).name


def read_manifest(data: bytes, path: str) -> Manifest:
    """Return the name and the version of the package in `data`, the bytes of a package.xml. Raises InputError.

    The parser is expat, because importing ElementTree takes longer than many builds.
    """
    from xml.parsers import expat

    parser = expat.ParserCreate()
    depth = 0
    parts: list[str] = []
    found: dict[str, str] = {}

    def start(element: str, _: object) -> None:
        nonlocal depth
        depth += 1
        if depth == 2 and element in Manifest._fields:  # noqa: PLR2004 - below the root
            parts.clear()
            parser.CharacterDataHandler = parts.append
        elif depth > 2:  # noqa: PLR2004 - in the name or the version
            parser.CharacterDataHandler = None

    def end(element: str) -> None:
        nonlocal depth
        if parser.CharacterDataHandler:
            found.setdefault(element, "".join(parts))
            parser.CharacterDataHandler = None
        depth -= 1

    def doctype(*_: object) -> None:
        place = parser.CurrentLineNumber, parser.CurrentColumnNumber + 1
        raise input_error(path, "S107", "a document type: expected plain XML without <!DOCTYPE>", *place)

    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    try:
        parser.Parse(data, True)  # noqa: FBT003 - it takes no keywords
    except expat.ExpatError as error:
        raise input_error(path, "S107", f"not XML: {error}", error.lineno, error.offset + 1) from None
    except (LookupError, ValueError) as error:  # an encoding that Python does not know
        raise input_error(path, "S107", f"not XML: {error}", 0) from None
    name, version = (found.get(field, "").strip() for field in Manifest._fields)
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise input_error(path, "S107", f"'{name}' is not a ROS package name", 0)
    return Manifest(name, version if re.fullmatch(r"\d{1,9}(?:\.\d{1,9}){2}", version, re.ASCII) else "")
