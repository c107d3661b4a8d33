"""A program that expands all EmPy templates of the tests and pages with the definitions of a release.

It writes to the folder `out`, and prints the version of EmPy, which the tests choose with PYTHONPATH.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import em

from msggen.cli import DONE, main
from support.catalogs import write_definitions
from support.firmware_trees import BRIDGE_PLACE, write_tree
from support.px4_scripts import KINDS
from support.repository import PX4_TREE, ROOT


def expand_all(release: str) -> None:
    """Expand the templates in the style of the firmware, and those of `msggen render`."""
    tree = write_tree(Path("tree"), release)
    includes = [str(place) for place in (tree / "msg", tree / "msg" / "versioned") if place.is_dir()]
    files = [str(path) for place in includes for path in sorted(Path(place).glob("*.msg"))]
    for kind in KINDS:
        templates = PX4_TREE / "Tools/msg/templates" / ("cdrstream" if kind == "--uorb-idl-header" else "uorb")
        out = str(Path("out", kind.strip("-")))
        run("px4-generate", kind, "-f", *files, "-i", *includes, "-e", str(templates), "-o", out)
    for template in (PX4_TREE / "src/modules").rglob("*.em"):
        topics = str(tree / BRIDGE_PLACE)
        run("px4-generate", "-y", topics, "-t", str(template), "-u", str(Path("out", template.parent.name)))
    page = (ROOT / "docs" / "render.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"as `table.csv.em`.*?```\n(.*?)```", page, re.DOTALL)
    write_definitions(Path(), {"table.csv.em": text})
    run("render", "-q", "--px4", str(tree), "--template", "table.csv.em", "-o", "out/render")


def run(*arguments: str) -> None:
    """Run a command of msggen in this process."""
    assert main([*arguments]) == DONE, arguments


if __name__ == "__main__":
    expand_all(sys.argv[1])
    print(em.__version__)
