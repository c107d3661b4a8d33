"""Folders that a stranger made: links, fifos, long names, crafted records and git configurations, at every place.

A command changes nothing but its output: neither its inputs nor what links lead to, and it starts no program of the
folder. It ends with 0, 1 or 2, without a trace.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple
from unittest.mock import patch

from msggen.base.disk.record import digest
from support.catalogs import write_definitions
from support.commands import check_outcome, run
from support.disk_tasks import copy_start
from support.scratch import inside, scratch_folder

COUNT = 150

OUTSIDE = {
    "file": "mine\n",
    "Rpm.msg": "uint64 timestamp\nfloat32 mine\n",
    "folder/inner.py": "mine\n",
    "empty/.keep": "",
}
"""Files that no command may change."""

COMMANDS = {
    "build": (("build", "--px4", "new", "-o", "out"), "out"),
    "build into a folder": (("build", "--px4", "new", "-o", "out", "--package", "msg"), "out"),
    "build with a depfile": (("build", "--px4", "new", "-o", "out", "--depfile", "out/d.d"), "out"),
    "build --check": (("build", "--px4", "new", "-o", "out", "--check"), ""),
    "build --diff": (("build", "--px4", "new", "-o", "out", "--diff"), ""),
    "sync": (("sync", "--px4", "new", "px4_msgs"), "px4_msgs"),
    "sync --create": (("sync", "--px4", "new", "--create", "px4_msgs"), "px4_msgs"),
    "sync --diff": (("sync", "--px4", "new", "px4_msgs", "--diff"), ""),
    "render": (("render", "--px4", "new", "--template", "a.hpp.j2", "-o", "rendered"), "rendered"),
    "docs": (("docs", "--px4", "new", "-o", "rendered"), "rendered"),
    "bump": (("bump", "--px4", "tree", "--against", "HEAD"), "tree"),
    "check": (("check", "px4_msgs", "new"), ""),
    "breaking": (("breaking", "--px4", "tree", "--against", "HEAD"), ""),
    "build a revision": (("build", "--px4", "tree@HEAD", "-o", "out"), "out"),
    "px4-generate": (("px4-generate", "-y", "new/dds_topics.yaml", "-t", "a.em", "-o", "rendered/a.h"), "rendered"),
}
"""Arguments, and the only folder that the command may change."""

PLACES = (
    *("out/px4_types", "out/px4_types/.msggen.json", "out/px4_types/.msggen.json.new"),
    *("out/px4_types/.msggen.json.msggen-new",),
    *("out/px4_types/.msggen-stage", "out/px4_types/.msggen_cache", "out/px4_types/.msggen_cache/fingerprint.json"),
    *("out",),
    *("out/px4_types/.msggen_cache/.gitignore", "out/px4_types/msg", "out/px4_types/msg/_rpm.py"),
    *("out/px4_types/cdr.py",),
    *("out/px4_types/msg/_wind.py", "out/px4_types/msg/_debug_vect.py", "out/px4_types/srv", "out/.msggen-stage"),
    *("out/d.d",),
    *("out/d.d.tmp", "out/d.d.new", "out/d.d.msggen-new", "out/msg", "out/px4_types/__init__.py"),
    *("out/px4_types.msggen-new",),
    *("out/px4_types.new", "out/px4_types.old", "out/.px4_types.msggen-stage", "px4_msgs", "px4_msgs/msg"),
    *("px4_msgs/msg/Rpm.msg",),
    *("px4_msgs/.msggen.json", "px4_msgs/.msggen.json.msggen-new", "px4_msgs/.msggen-stage"),
    *("px4_msgs/.msggen-stage/msg",),
    *("px4_msgs/CMakeLists.txt", "px4_msgs/package.xml", "px4_msgs/msg/Wind.msg", "px4_msgs/msg/Rpm.msg.msggen-new"),
    *("px4_msgs/msg/DebugVect.msg", "px4_msgs/srv", "px4_msgs/.git", "px4_msgs/.git/config", "rendered"),
    *("rendered/Rpm.hpp",),
    *("rendered/rpm.hpp", "rendered/.msggen-stage", "rendered/a.h", "tree/msg", "tree/msg/versioned"),
    *("tree/msg/px4_msgs_old",),
    *("tree/msg/px4_msgs_old/msg", "tree/msg/versioned/VehicleStatus.msg"),
    *("tree/msg/versioned/VehicleStatus.msg.msggen-new",),
    *("tree/msg/translation_node/translations/all_translations.h", "tree/msg/px4_msgs_old/msg/VehicleStatusV1.msg"),
    *("tree/.git",),
    *("tree/.git/config", "tree/.git/index.lock", "new/msg/Rpm.msg", "new/msg", "new/srv", "new/msg/versioned"),
    *("new/dds_topics.yaml",),
    *("new/package.xml", "new/msg/Foo.msg", "new/.git", "new/pyproject.toml", "pyproject.toml", "a.hpp.j2", "a.em"),
    *(".git",),
)
"""Places in the folder where a stranger puts something."""

NAMES = (
    *("msg/_rpm.py", "msg/_wind.py", "../../outside/file", "../outside/file", "msg/../../../outside/file"),
    *("/outside/file", "x"),
    *("msg/inner.py", "msg/Wind.msg", "msg/inner.msg", "srv/inner.py", "cdr.py", ".", "", "msg", "a" * 300 + ".py"),
    *("A" * 130 + ".msg",),
)
"""Names in a crafted record."""

GIT = (
    *("[core]\n\tfsmonitor = {p}\n", '[filter "x"]\n\tclean = {p}\n\tsmudge = {p}\n\tprocess = {p}\n'),
    *("[core]\n\tsshCommand = {p}\n",),
    *("[core]\n\thooksPath = {h}\n", "[core]\n\tpager = {p}\n[pager]\n\trev-parse = true\n"),
    *("[core]\n\tgitProxy = {p}\n", "[a\n"),
    *('[remote "origin"]\n\turl = {r}\n\tuploadpack = {p}\n\tpromisor = true\n[extensions]\n\tpartialClone=origin\n',),
    *("[core]\n\tworktree = {r}\n", "[include]\n\tpath = {r}/file\n"),
    *('[diff "x"]\n\ttextconv = {p}\n\tcommand = {p}\n', "[credential]\n\thelper = {p}\n"),
    *("[diff]\n\texternal = {p}\n", "[gpg]\n\tprogram = {p}\n[log]\n\tshowSignature = true\n"),
    *("[core]\n\talternateRefsCommand = {p}\n",),
)
"""Configurations of git that start the program {p}, or lead to the folder {r}; {h} is a folder of hooks."""


class Oddity(NamedTuple):
    """Something at a place: a link to `text`, a fifo, a folder, or a file with the content `text`."""

    place: str
    kind: str
    text: str = ""


class Case(NamedTuple):
    """The oddities in a folder, and the command."""

    command: str
    oddities: tuple[Oddity, ...]


def case(chance: Random) -> Case:
    command = chance.choice(list(COMMANDS))
    words, target = COMMANDS[command]
    near = [place for place in PLACES if place.partition("/")[0] in (target, *words)]
    count = chance.choice((1, 1, 1, 2, 2, 3, 4))
    return Case(command, tuple(_oddity(chance, near if chance.random() < 0.8 else PLACES) for _ in range(count)))


def _oddity(chance: Random, places: Sequence[str]) -> Oddity:
    place = chance.choice(places)
    if chance.random() < 0.15:
        return Oddity(
            chance.choice(("tree/.git/config", "px4_msgs/.git/config", "new/.git/config")), "git", chance.choice(GIT)
        )
    if place.endswith(".msggen.json") and chance.random() < 0.8:
        names = {name: chance.choice(("0f", digest(b"mine\n"), digest(b""))) for name in chance.sample(NAMES, 4)}
        return Oddity(place, "file", json.dumps({"files": names}))
    kind = chance.choice(("link", "link", "link", "link", "fifo", "folder", "file", "read-only"))
    if kind == "link":
        is_input = place.startswith("new/")
        return Oddity(place, kind, chance.choice((*_TARGETS, *("/dev/zero",) * (3 * is_input))))
    name = chance.choice(("x", "A" * 130 + ".msg", "A" * 240 + ".msg", "é.msg", "\n.msg", "_" * 250))
    return Oddity(place, kind, name if kind == "folder" else "x")


_TARGETS = (
    *("{o}/file", "{o}/folder", "{o}/empty", "{o}", "{o}/nothing", "{o}/nothing/deep", "{o}/Rpm.msg", "new"),
    *("new/msg", "."),
    *("loop", "{o}/../work/out", "{o}/folder/inner.py", "new/msg/Rpm.msg"),
)
"""Targets of links; {o} is the folder outside."""


def check(case: Case) -> None:
    arguments, target = COMMANDS[case.command]
    with scratch_folder() as folder, patch("msggen.base.disk.git.SECONDS", 2):  # git waits for a fifo
        copy_start(folder / "work")
        write_definitions(folder / "outside", OUTSIDE)
        write_definitions(folder / "work", {"a.em": "text\n", "new/dds_topics.yaml": "publications: []\n"})
        program = folder / "program"
        program.write_text(f"#!/bin/sh\ntouch {folder}/outside/started\nexit 1\n")
        program.chmod(0o755)
        for oddity in case.oddities:
            put(folder, oddity)
        with inside(folder / "work"):
            before = dict(digests(folder, without=target))
            outcome = run(arguments)
            after = dict(digests(folder, without=target))
        changed = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
        assert not changed, f"changed outside of its output: {changed}"
        check_outcome(outcome)


def put(folder: Path, oddity: Oddity) -> None:
    """Put an oddity in its place, instead of what is there."""
    path = folder / "work" / oddity.place
    if path.parent.is_symlink() or path.parent.is_fifo() or path.parent.is_file():
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError:
        return  # below an oddity that is no folder
    if not os.path.realpath(path.parent).startswith(f"{folder}/work"):
        return
    if oddity.kind == "git":
        _put_git(folder, path, oddity.text)
        return
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        path.unlink()
    elif path.is_dir():
        shutil.rmtree(path)
    _PUT[oddity.kind](path, oddity.text.format(o=folder / "outside") if oddity.kind == "link" else oddity.text)


def _put_git(folder: Path, path: Path, text: str) -> None:
    if path.is_symlink() or not path.is_file() or not path.parent.joinpath("HEAD").exists():
        return
    config = text.format(p=folder / "program", r=folder / "outside", h=folder / "work" / "hooks")
    with path.open("a", encoding="utf-8") as stream:
        stream.write(config)
    (path.parent.parent / ".gitattributes").write_text("* filter=x diff=x\n")
    if "promisor" in text:  # git fetches what is missing
        shutil.rmtree(path.parent / "objects", ignore_errors=True)
        (path.parent / "objects").mkdir()
    hooks = folder / "work" / "hooks"
    hooks.mkdir(exist_ok=True)
    for name in ("post-checkout", "pre-commit", "reference-transaction", "post-index-change", "fsmonitor-watchman"):
        shutil.copy(folder / "program", hooks / name)


def _folder(path: Path, name: str) -> None:
    path.mkdir()
    if len(name.encode()) < 256:
        (path / name).write_text("uint64 timestamp\n")


def _read_only(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(0o400)


_PUT: dict[str, Callable[[Path, str], object]] = {
    "link": lambda path, text: path.symlink_to(text),
    "fifo": lambda path, _: os.mkfifo(path),
    "folder": _folder,
    "file": lambda path, text: path.write_text(text),
    "read-only": _read_only,
}


def digests(folder: Path, without: str) -> Iterator[tuple[str, str]]:
    """Yield every file below `folder` except in `work/<without>`, with its type, mode, size, and content."""
    left_out = str(folder / "work" / without) if without else ""
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if os.path.join(place, name) != left_out or os.path.islink(left_out)]
        for name in (*folders, *files):
            path = os.path.join(place, name)
            mode = os.lstat(path).st_mode
            if path == left_out or "/.git/" in path:
                continue
            content = os.readlink(path) if stat.S_ISLNK(mode) else ""
            if stat.S_ISREG(mode):
                content = digest(Path(path).read_bytes())
            yield path, f"{mode:o} {content}"
