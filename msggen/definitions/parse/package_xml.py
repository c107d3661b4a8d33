"""The parser of package.xml, which reads the name of the ROS package (REP 149)."""

import re

from msggen.base.diagnostics import input_error


def package_name(data: bytes, path: str) -> str:
    """Return the name of the package in `data`, the bytes of a package.xml. Raises InputError.

    The parser is expat, because importing ElementTree takes longer than many builds.
    """
    from xml.parsers import expat

    parser = expat.ParserCreate()
    depth = 0
    parts: list[str] = []
    names: list[str] = []

    def start(element: str, _: object) -> None:
        nonlocal depth
        depth += 1
        if (depth, element) == (2, "name"):
            parser.CharacterDataHandler = parts.append
        elif depth > 2:  # noqa: PLR2004 - in the name
            parser.CharacterDataHandler = None

    def end(_: str) -> None:
        nonlocal depth
        if parser.CharacterDataHandler:
            names.append("".join(parts))
            parts.clear()
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
    name = names[0].strip() if names else ""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise input_error(path, "S107", f"'{name}' is not a ROS package name", 0)
    return name
