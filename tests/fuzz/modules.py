"""Packages generated from random definitions whose comments, strings, names and constants try to become code.

Every message imports, and encodes and decodes as in reference.py, in every encoding. No text is executed.
"""

from __future__ import annotations

import importlib
import re
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

from msggen.base.diagnostics import InputError
from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from support.catalogs import write_definitions
from support.other_codecs import Generated, everything, generated
from support.random_definitions import PACKAGES, TOLERATED, random_catalog, values_of
from support.reference import HEADERS, deserialize, serialize
from support.scratch import scratch_folder

COUNT = 60

CANARY = "msggen_canary"
"""A module that code in a definition adds to the modules that are loaded."""

CODE = f"__import__('sys').modules.__setitem__('{CANARY}', 1)"

PIECES = (
    *(CODE, f'""" + {CODE} + """', f'"""; {CODE}; """', f"'''; {CODE}; '''", f'" + str({CODE}) + "', f"' + {CODE} + '"),
    *(f"\\n{CODE}", f"{{{{ {CODE} }}}}", f"{{% set x = {CODE} %}}", f"{{{CODE}}}", f"@({CODE})", f"@{{{CODE}}}@"),
    *(f"\\N{{DIGIT ONE}}{CODE}", f"\u2028{CODE}", f"\u0085{CODE}", f"\x0c{CODE}", f"\r{CODE}", f"\\\r{CODE}"),
    *(f"\x1b[2J{CODE}",),
    *('"', '"""', "'", "'''", "\\", "\\\\", '\\"', "\\x", "\\N{", "\\u12", "{{", "}}", "{%", "%}", "{#", "%s"),
    *("%(x)s", "{0}"),
    *("[m]", "[@range 0, 1]", "[@enum CONSTANT]", "[@invalid NaN]", "[@frame NED]", "[@unit m]", "[", "]"),
    *("# TOPICS a", "---"),
    *("é", "例", "🚁", "\u202e", "\ufeff", "\xa0", "type: ignore", "noqa", "-*- coding: utf-16 -*-", "x" * 500),
    *("word " * 100,),
)
NAMES = (
    *("class", "def", "self", "cls", "import", "lambda", "print", "encode", "decode", "lazy", "dtype", "from_row"),
    *("upgrade", "async", "match", "int", "float", "bytes", "tuple", "property", "classmethod", "str", "type"),
    *("super",),
)
"""Names with a meaning in Python or in a generated class."""

Case = dict[str, str]
"""Texts of definitions by path, below a folder for each package."""


def case(chance: Random) -> Case:
    with tempfile.TemporaryDirectory() as folder:
        while not Path(folder, PACKAGES[0]).exists():
            with suppress(InputError):  # none of the definitions is in the first package
                random_catalog(Path(folder), chance, chance.randint(1, 5), chance.randint(0, 1))
        paths = sorted(path for path in Path(folder).rglob("*.*") if path.suffix in (".msg", ".srv"))
        return {str(path.relative_to(folder)): _decorated(chance, path.read_text(encoding="utf-8")) for path in paths}


def _decorated(chance: Random, text: str) -> str:
    """Return a definition with comments around and behind its lines, other names, and strings that contain code."""
    names = {f"field{number}": name for number, name in enumerate(chance.sample(NAMES, 8)) if chance.random() < 0.3}
    lines = []
    for line in text.split("\n"):
        for name, other in names.items():
            line = re.sub(rf"\b{name}\b", other, line)  # noqa: PLW2901 - each name in turn
        lines += [f"# {_comment(chance)}"] * (chance.random() < 0.2)
        lines += [""] * (chance.random() < 0.2)
        is_code = line and line != "---"
        lines.append(f"{line}  # {_comment(chance)}" if is_code and chance.random() < 0.5 else line)
        if is_code and chance.random() < 0.1:
            quoted = _comment(chance).replace("\\", "\\\\").replace('"', '\\"')
            lines.append(f'string TEXT_{len(lines)} = "{quoted}"')
    return "\n".join(lines)


def _comment(chance: Random) -> str:
    return "".join(chance.choice(PIECES) for _ in range(chance.choice((1, 1, 2, 3, 6))))


def check(case: Case) -> None:
    sys.modules.pop(CANARY, None)
    with scratch_folder() as folder, warnings.catch_warnings():
        warnings.simplefilter("error", SyntaxWarning)
        warnings.simplefilter("error", DeprecationWarning)
        write_definitions(folder, case)
        catalog = _catalog(folder)
        if catalog is None:
            return
        with generated(catalog, folder) as made:
            for message in everything(catalog):
                if message.location.path.startswith(PACKAGES):
                    check_message(made, message)
            _use_everything(made.types, catalog)
    assert CANARY not in sys.modules, "text of a definition was executed"


def _catalog(folder: Path) -> Catalog | None:
    """Return the catalog of a case, None if it has a name twice."""
    own, other = PACKAGES
    others = (f"{other}={other}",) if (folder / other).exists() else ()
    try:
        return read_catalog(find_sources(own, others), tolerated=TOLERATED)
    except InputError as error:
        if {found.code for found in error.diagnostics} <= {"M203", "M402"}:
            return None
        raise


def check_message(made: Generated, message: Any) -> None:
    """Check that a message encodes and decodes as in reference.py."""
    chance = Random(message.name)  # noqa: S311 - not used for security
    for order, version in HEADERS:
        values = values_of(made.catalog, message, chance)
        sample = serialize(made.catalog, message, values, order, version)
        assert repr(made.decode(message, sample)) == repr(deserialize(made.catalog, message, sample))
        assert "nan" in repr(values) or made.encode(message, values, order, version) == sample
    cls = made.cls(message)
    assert cls().encode() == cls.decode(cls().encode()).encode()
    assert len(cls.__msg__.fields) == len(message.fields)


def _use_everything(types: Any, catalog: Any) -> None:
    """Import all modules of the package, and read what is made on first use."""
    for message in everything(catalog):
        if message.package == catalog.package:
            cls = getattr(types, message.name)
            assert cls.__doc__
            assert repr(cls())
            topics = importlib.import_module(f"{cls.__module__.partition('.')[0]}.topics")
            assert topics.ORB_ID is not None
            assert topics.UORB is not None
