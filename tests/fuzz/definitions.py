"""Definitions of the firmware and random ones, changed at random.

msggen reads them into a catalog, or reports errors with a location in the file, in time linear in their size.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from random import Random

from msggen import Encoding, endpoints, is_static, lay_out, message_hash, type_hash, uorb_topics
from msggen.base.diagnostics import CODES, Diagnostic, InputError
from msggen.definitions.model import Catalog
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources
from msggen.sources.tree import Snapshot
from support.mutations import Mutator
from support.random_definitions import TOLERATED, random_catalog
from support.repository import ROOT

COUNT = 2000

WORDS = tuple(
    word.encode()
    for word in (
        *("uint8", "float32", "float64", "bool", "char", "byte", "string", "wstring", "string<=3", "Rpm"),
        *("px4_msgs/Rpm",),
        *("uint64 timestamp\n", "uint64 timestamp # time since system start\n", "# TOPICS a b", "# TOPICS  a", "---"),
        *("---\n",),
        *("[3]", "[]", "[<=3]", "[<=", "[0]", "[-1]", "[99999999999]", " = 1", " = ", "=", "'a'", '"', "[1, 2]", "["),
        *("]",),
        *("# ", "#", "##", "@range 0, 1", "[@range 0, 1]", "[@enum A]", "[@invalid NaN]", "[@frame NED]", "[m/s]"),
        *("[@",),
        *("uint32 MESSAGE_VERSION = 1\n", "uint8 ORB_QUEUE_LENGTH = 4\n", "uint8 A = 1 # [@enum A]\n", " x", " X = 1"),
        *("\n# \n", "\n\n", "a" * 200, "A" * 200, "/", "../", "<", ">", "(", ")", ",", ";", "\\", "`", "$", "{{", "%}"),
    )
)

_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
"""Characters that would change what a terminal shows."""

LONGEST = 4000
"""The most characters of an error."""

Case = dict[str, bytes]
"""Contents by path."""


@cache
def samples() -> dict[str, tuple[bytes, ...]]:
    """Return texts of definitions by suffix."""
    folder = Path(tempfile.mkdtemp())
    random_catalog(folder, Random(0), 60, 10)  # noqa: S311 - not used for security
    return {
        suffix: tuple(
            path.read_bytes() for place in (ROOT / kind, folder) for path in sorted(place.rglob(f"*.{suffix}"))
        )
        for kind, suffix in (("msg", "msg"), ("srv", "srv"))
    }


@cache
def mutator() -> Mutator:
    """Return the mutator of definitions."""
    return Mutator(WORDS, (*samples()["msg"], *samples()["srv"]))


def case(chance: Random) -> Case:
    found = {}
    for number in range(chance.choice((1, 1, 1, 2, 3))):
        kind = chance.choice(("msg", "msg", "msg", "srv"))
        name = chance.choice(("Rpm", "Foo", "Bar", f"Message{number}"))
        found[f"{kind}/{name}.{kind}"] = mutator().mutated(chance, chance.choice(samples()[kind]))
    return found


def check(case: Case) -> None:
    tolerated = () if len(case) == 1 else TOLERATED
    try:
        catalog = read_catalog(find_sources(Snapshot("fuzz", case, {})), tolerated=tolerated)
    except InputError as error:
        check_diagnostics((*error.diagnostics, *error.notices), case)
        return
    check_diagnostics(catalog.notices, case)
    use(catalog)


def check_diagnostics(diagnostics: Iterable[Diagnostic], files: Mapping[str, bytes]) -> None:
    """Check that errors are known, of one short line each, and that their locations are in `files`."""
    lines = {f"fuzz/{path}": lines_of(path, data) for path, data in files.items()}
    for found in diagnostics:
        check_text(found)
        path, line, column = found.location
        if line and line > len(lines[path]):
            assert line == len(lines[path]) + 1, found  # the end of the file, for YAML
        elif line:
            assert 1 <= column <= len(lines[path][line - 1]) + 1, found


def check_text(found: Diagnostic) -> None:
    """Check that an error is known, and a single short line."""
    assert found.code in CODES
    assert not _CONTROL.search(str(found)), found
    assert len(str(found)) < LONGEST, len(str(found))


def lines_of(path: str, data: bytes) -> list[str]:
    """Return the lines of a file. YAML has further line ends."""
    text = data.decode(errors="replace")
    return re.split("\r\n|[\r\n\x85\u2028\u2029]", text) if path.endswith(".yaml") else text.split("\n")


def use(catalog: Catalog) -> None:
    """Derive every fact from a catalog."""
    for message in catalog.messages.values():
        message_hash(catalog, message)
        type_hash(catalog, message)
        if is_static(catalog, message):
            for encoding in Encoding:
                lay_out(catalog, message, encoding)
    uorb_topics(catalog)
    endpoints(catalog)
