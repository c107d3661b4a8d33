"""Random command lines of every command, in a folder with a firmware, a package and files that are not what they seem.

Each run ends with the exit code 0, 1 or 2, without a trace, and explains the 2.
"""

from __future__ import annotations

import argparse
import shutil
import tarfile
import tempfile
from functools import cache
from pathlib import Path
from random import Random

from msggen.base.diagnostics import CODES
from msggen.cli.parser import _MODULES, parser_for
from msggen.show.report.table import RULES
from support.catalogs import write_definitions
from support.commands import check_outcome, run
from support.packages import BRIDGE, BRIDGE_PLACE, committed, definition, git
from support.scratch import inside, scratch_folder

COUNT = 150

ON_A_LINK = frozenset(
    ("sim", "link", "topic", "top", "command", "call", "record", "play", "view", "doctor", "relay", "mcp")
)
COMMANDS = tuple(name for name in _MODULES if name not in ON_A_LINK)
"""The commands that end by themselves, and need no other process."""

Case = tuple[str, ...]
"""The arguments."""

TREE = {
    **{f"msg/{name}.msg": definition(name) for name in ("Rpm", "EscReport", "EscStatus")},
    "msg/versioned/VehicleStatus.msg": definition("VehicleStatus"),
    "msg/CMakeLists.txt": "set(msg_files EscReport.msg EscStatus.msg Rpm.msg versioned/VehicleStatus.msg)\n",
    "srv/Ask.srv": "uint8 a\n---\nuint8 b\n",
    "boards/px4/sitl/default.px4board": "CONFIG_A=y\n",
    "Kconfig": "config A\n\tbool a\n",
    BRIDGE_PLACE: BRIDGE,
}
FILES = {
    "bad/msg/Bad.msg": "uint9 a\n",
    "empty/notes.txt": "",
    "a.hpp.j2": "{{ message.name }}{% for field in message.fields %}{{ field.name }}\n{% endfor %}",
    "bad.j2": "{% for x in %}",
    "a.em": "@(msg_name)\n",
    "other_msgs/package.xml": "<package><name>other_msgs</name></package>",
    "other_msgs/msg/Header.msg": "string frame_id\n",
    "topics.yaml": "publications: [{topic: /fmu/out/rpm, type: 'px4_msgs::msg::Rpm'}]\n",
    "bad.yaml": "a: [",
    "broken.tar.gz": "no archive",
}
WORDS = (
    *("PX4", "PX4/msg", "PX4@HEAD", "PX4@HEAD~1", "PX4@nothing", "PX4@", "@HEAD", "PX4.tar", "broken.tar.gz"),
    *("px4_msgs", "bad"),
    *("empty", "other_msgs", "other_msgs=other_msgs", "x=", "=x", "a=b=c", "none", "none/deep/er", ".", ".."),
    *("./PX4", "PX4/", "PX4/.."),
    *(
        "v1.18",
        "v1.14",
        "v1.99",
        "embedded:v1.16",
        "installed",
        "installed:x",
        "main",
        "topics.yaml",
        "bad.yaml",
        "a.hpp.j2",
        "bad.j2",
        "a.em",
    ),
    *("out", "out2"),
    *("px4_types", "class", "a.b", "a-b", "1a", "a b", "\n", "\t", "\0", "é", "🚁", "\udcff", "a" * 300, "-", "--"),
    *("-x", "--no", "%s"),
    *("{name}.hpp", "{message.name}", "{", "{}", "{0}", "{name.__class__}", "../{name}", "px4_sitl_default", "sitl"),
    *("x.px4board",),
    *("Rpm", "VehicleStatus", "EscStatus", "Nothing", "px4_msgs/Rpm", "1", "-1", "HEAD", "HEAD~1", "main..HEAD"),
    *("--upload-pack=x", ":0"),
    *("-", "json", "sarif", "junit", "github", "full", "concise", "ALL", "WIRE", "SEMANTIC", ",", "PX4/msg/Rpm.msg"),
    *("PX4/msg", "PX4/Kconfig"),
    *sorted(CODES)[::9],
    *[rule.id for rule in RULES][::5],
)
LIKELY: dict[str, tuple[str, ...]] = {
    "build": ("--px4", "PX4", "-o", "out"),
    "sync": ("--px4", "PX4", "px4_msgs"),
    "check": ("PX4", "PX4@HEAD~1"),
    "breaking": ("--px4", "PX4", "--against", "HEAD~1"),
    "bump": ("--px4", "PX4", "--against", "HEAD~1", "VehicleStatus"),
    "render": ("--px4", "PX4", "--template", "a.hpp.j2", "-o", "out"),
    "docs": ("--px4", "PX4", "-o", "out", "--against", "HEAD~1"),
    "px4-generate": ("--headers", "-f", "PX4/msg/Rpm.msg", "-i", "PX4/msg", "-o", "out", "-e", "."),
    "explain": ("FIELD_MOVED",),
}
"""Arguments that make a command do its work."""


@cache
def options(command: str) -> tuple[str, ...]:
    """Return the options of a command."""
    (commands,) = (each for each in parser_for([command])._actions if isinstance(each, argparse._SubParsersAction))
    found = commands.choices[command]._option_string_actions if command in commands.choices else ()
    return tuple(option for option in found if option != "--live")  # it waits for a vehicle


def case(chance: Random) -> Case:
    command = chance.choice((*COMMANDS, *LIKELY, *LIKELY, "--version", "buidl"))
    words = list(LIKELY.get(command, ())) if chance.random() < 0.7 else []
    known = options(command) if command in _MODULES else ()
    for _ in range(chance.choice((0, 1, 1, 2, 3, 5))):
        at = chance.randint(0, len(words))
        change = chance.random()
        if change < 0.5 and known:
            option = chance.choice(known)
            words[at:at] = [option, chance.choice(WORDS)][: chance.choice((1, 2, 2))]
        elif change < 0.6 and known:
            words.insert(at, f"{chance.choice(known)}={chance.choice(WORDS)}")
        elif change < 0.85:
            words.insert(at, chance.choice(WORDS))
        elif words:
            words[min(at, len(words) - 1)] = chance.choice(WORDS)
    return (command, *words)


@cache
def world() -> Path:
    """Return a folder with everything that WORDS name, to be copied for each case."""
    folder = Path(tempfile.mkdtemp())
    write_definitions(folder, FILES)
    write_definitions(folder / "PX4", {**TREE, "msg/Rpm.msg": TREE["msg/Rpm.msg"] + "uint8 old\n"})
    committed(folder / "PX4")
    write_definitions(folder / "PX4", TREE)
    git(folder / "PX4", "commit", "-q", "-a", "-m", "newer")
    with inside(folder):
        with tarfile.open("PX4.tar", "w") as archive:
            archive.add("PX4/msg")
        assert run(["sync", "-q", "--px4", "PX4", "--create", "px4_msgs"]).code == 0
    return folder


def check(case: Case) -> None:
    origin = world()
    with scratch_folder() as folder:
        shutil.copytree(origin, folder / "work", symlinks=True)
        with inside(folder / "work"):
            check_outcome(run(case))
