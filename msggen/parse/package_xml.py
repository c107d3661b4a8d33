"""The parser of package.xml, which reads the name of the ROS package (REP 149)."""

import re

from msggen.diagnostics import input_error


def package_name(data: bytes, path: str) -> str:
    """Return the name of the package in `data`, the bytes of a package.xml. Raises InputError.

    The parser is expat, because importing ElementTree takes longer than many builds.
    """
    from xml.parsers import expat

    parser = expat.ParserCreate()
    open_elements: list[str] = []
    names: list[str] = []

    def start(element: str, _: object) -> None:
        open_elements.append(element)
        if open_elements[1:] == ["name"]:
            names.append("")

    def end(_: str) -> None:
        open_elements.pop()

    def text(found: str) -> None:
        if open_elements[1:] == ["name"]:
            names[-1] += found

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, text
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
