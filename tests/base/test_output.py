"""Tests that nothing outside of the output is written or removed, and that failures leave it as it was."""

from __future__ import annotations

import errno
import hashlib
import itertools
import json
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from msggen.base.disk import files, swap
from msggen.base.disk.names import too_long
from msggen.cli import main
from support.catalogs import write_definitions
from support.disk_calls import hooked
from support.examples import by_day, examples
from support.packages import RECORD, content, identity

STAMP = "uint64 timestamp\n"
PACKAGE = Path("generated/px4_types")
SIBLING = Path("generated/.px4_types.msggen-stage")
CACHE = ".msggen_cache"

pytestmark = pytest.mark.usefixtures("working_folder")


def build(*arguments: str) -> int:
    """Run `msggen build` on the definitions in `in`; return the exit code."""
    return main(["build", "-q", "--px4", "in", *arguments])


def definitions(*names: str) -> None:
    """Make `in` a source of these messages only."""
    shutil.rmtree("in", ignore_errors=True)
    write_definitions(Path("in/msg"), {f"{name}.msg": STAMP for name in names})


def code(folder: Path = PACKAGE) -> dict[str, bytes | str | None]:
    """Return the contents of a package without hidden files."""
    return {name: data for name, data in content(folder).items() if not name.startswith(".")}


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def record_more(files: dict[str, str]) -> None:
    """Add names to the record, as in a repository of a stranger."""
    stored = json.loads((PACKAGE / RECORD).read_text())
    stored["files"] |= files
    (PACKAGE / RECORD).write_text(json.dumps(stored))


# --- A stranger's repository


TEMPORARY = [
    f"generated/px4_types/{RECORD}.msggen-new",
    f"generated/px4_types/{CACHE}/fingerprint.json.msggen-new",
    f"generated/px4_types/{CACHE}/.gitignore.msggen-new",
    "generated/px4_types/.msggen-stage",
    str(SIBLING),
    "types.d.msggen-new",
]


KINDS_OF_VICTIMS = ("file", "hard link", "dangling link", "folder")


@by_day(
    ("name", "kind", "how"), itertools.product(TEMPORARY, KINDS_OF_VICTIMS, ("swapped", "file by file")), 5
)  # by day each name, each kind and each way, not all of their pairs
def test_nothing_is_written_through_a_temporary_name(
    name: str, kind: str, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    definitions("Rpm")
    assert build("--depfile", "types.d") == 0
    definitions("Rpm", "Fan", "Lamp")
    victim = Path("victim")
    write_definitions(victim, {"file": "mine", ".gitignore": "mine"})
    Path(name).parent.mkdir(exist_ok=True)
    if kind == "hard link":
        os.link("victim/file", name)
    else:
        Path(name).symlink_to({"file": victim / "file", "folder": victim}.get(kind, victim / "none").resolve())
    before = content(victim)
    if how == "file by file":
        monkeypatch.setattr(swap, "_renameat2", lambda: None)
    build("--depfile", "types.d")
    assert content(victim) == before


@pytest.mark.parametrize("folder", ["msg", "srv", "."])
def test_a_folder_of_the_package_that_is_a_link_is_refused(folder: str, capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    write_definitions(Path("in/srv"), {"Ask.srv": "bool a\n---\nbool b\n"})
    victim = write_definitions(Path("victim"), {"file": "mine"})
    place = Path(os.path.normpath(PACKAGE / folder))
    place.parent.mkdir(parents=True)
    place.symlink_to(victim.resolve())
    for option in ((), ("--check",)):
        assert build(*option) == 2
        assert f"{place}: S115 symbolic link to " in capsys.readouterr().err
    assert content(victim) == {"file": b"mine"}


@pytest.mark.parametrize("linked", ["linked", "msg/linked", "linked/deep", "msg"])
def test_a_recorded_file_behind_a_link_is_not_removed(linked: str) -> None:
    definitions("Rpm")
    build()
    victim = write_definitions(Path("victim"), {"file": "mine", "more/file": "mine"})
    top = PACKAGE / linked.split("/deep", maxsplit=1)[0]
    if top.exists():
        shutil.rmtree(top)
    top.symlink_to(victim.resolve())
    record_more({f"{linked}/file": digest("mine"), f"{linked}/more/file": digest("mine")})
    definitions("Fan")
    build()
    assert content(victim) == {"file": b"mine", "more": None, "more/file": b"mine"}


def test_a_recorded_file_that_is_a_link_is_replaced_and_its_target_stays() -> None:
    definitions("Rpm")
    build()
    victim = write_definitions(Path("victim"), {"file": "mine"})
    for name in ("msg/_rpm.py", "cdr.py", RECORD):
        (PACKAGE / name).unlink()
        (PACKAGE / name).symlink_to(victim.resolve() / "file")
    build()
    assert content(victim) == {"file": b"mine"}


@pytest.mark.parametrize("command", ["render", "px4-generate"])
def test_other_commands_write_through_no_link_either(command: str) -> None:
    definitions("Rpm")
    victim = write_definitions(Path("victim"), {"file": "mine"})
    Path("any.h.j2").write_text("{{ message.name }}\n")
    Path("out").mkdir()
    Path("out/.msggen-stage").symlink_to(victim.resolve())
    Path("out/sub").symlink_to(victim.resolve())
    if command == "render":
        run = ["render", "--px4", "in", "--template", "any.h.j2", "-o", "out"]
        assert main([*run, "--name", "sub/file"]) == 2
    else:
        write_definitions(Path("templates"), {"msg.h.em": "@(spec.short_name)\n", "msg/msg.h.em": ""})
        run = ["px4-generate", "--headers", "-f", "in/msg/Rpm.msg", "-o", "out", "-e", "templates", "-i", "in/msg"]
    assert main(run) == 2
    assert content(victim) == {"file": b"mine"}


# --- The depfile


@pytest.mark.parametrize("name", ["in/msg/Rpm.msg", "README.md", "link", "folder", "fifo", "copy.d", "craft.d"])
def test_a_depfile_replaces_only_a_depfile(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    write_definitions(Path(), {"README.md": "# mine\n", "victim": "", "folder/file": ""})
    Path("link").symlink_to("victim")
    os.mkfifo("fifo") if name == "fifo" else None
    if name == "copy.d":
        os.link("in/msg/Rpm.msg", "copy.d")
    if name == "craft.d":
        Path("craft.d").write_text(f"# : \\\n{STAMP}")
        Path("in/msg/Fan.msg").symlink_to(Path("craft.d").resolve())
    before = {path: os.lstat(path) for path in map(str, Path().rglob("*"))}
    assert build("--depfile", name) == 2
    assert capsys.readouterr().err.startswith(f"{name}: S123 this exists and is not a depfile")
    assert {path: os.lstat(path).st_mtime_ns for path in map(str, Path().rglob("*"))} == {
        path: state.st_mtime_ns for path, state in before.items()
    }


@pytest.mark.parametrize(
    "name", [str(PACKAGE / "__init__.py"), str(PACKAGE / "more/types.d"), str(PACKAGE), "generated"]
)
def test_a_depfile_that_overlaps_with_the_package_is_refused_before_anything_is_written(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    definitions("Rpm")
    assert build("--depfile", name) == 2
    assert capsys.readouterr().err.startswith(f"{name}: S123 this overlaps with {PACKAGE}, an output of this run")
    assert os.listdir() == ["in"]


@pytest.mark.parametrize("name", ["out/rpm.h", "out/rpm.h/deps.d", "out"])
def test_a_depfile_that_overlaps_with_a_rendered_file_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    Path("any.h.j2").write_text("{{ message.name }}\n")
    assert main(["render", "--px4", "in", "--template", "any.h.j2", "-o", "out", "--depfile", name]) == 2
    assert capsys.readouterr().err.startswith(f"{name}: S123 this overlaps with out/rpm.h, an output of this run")
    assert not Path("out").exists()


def test_a_depfile_that_overlaps_through_a_link_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    Path("generated").mkdir()
    Path("link").symlink_to("generated")
    assert build("--depfile", "link/px4_types/__init__.py") == 2
    assert "S123 this overlaps with generated/px4_types" in capsys.readouterr().err
    assert os.listdir("generated") == []


def test_an_empty_file_and_an_earlier_depfile_are_replaced() -> None:
    definitions("Rpm")
    Path("types.d").touch()
    assert build("--depfile", "types.d") == 0
    definitions("Fan", "Rpm")
    assert build("--depfile", "types.d", "-o", "else") == 0
    assert "Fan.msg" in Path("types.d").read_text()


@pytest.mark.parametrize("name", ["a\nb", "a\tb", "a\rb"])
def test_a_path_that_make_cannot_read_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path(name), {"Rpm.msg": STAMP})
    assert main(["build", "-q", "--msg-dir", name, "--depfile", "types.d"]) == 2
    assert "types.d: S123 a depfile cannot list" in capsys.readouterr().err
    assert sorted(os.listdir()) == [name]
    assert main(["build", "-q", "--msg-dir", name]) == 0


# --- The place of the package


@pytest.mark.parametrize(
    ("folder", "package"),
    [("fw", "msg"), ("fw", "srv"), ("fw/msg", "px4_types"), ("fw/msg/versioned", "x"), (".", "fw"), ("link", "msg")],
)
def test_a_package_is_apart_from_its_sources(folder: str, package: str, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"msg/Rpm.msg": STAMP, "msg/versioned/Fan.msg": STAMP, "srv/Ask.srv": "bool a\n---\nbool b\n"}
    write_definitions(Path("fw"), files)
    Path("link").symlink_to("fw")
    before = content(Path())
    for option in ((), ("--check",)):
        assert main(["build", "--px4", "fw", "-o", folder, "--package", package, *option]) == 2
        assert f"{os.path.join(folder, package)}: S124 " in capsys.readouterr().err
    assert content(Path()) == before


def test_a_package_beside_definitions_in_a_plain_folder_is_fine() -> None:
    write_definitions(Path("bare"), {"Rpm.msg": STAMP})
    for _ in range(2):
        assert main(["build", "-q", "--msg-dir", "bare", "-o", "bare"]) == 0


# --- Long names


LONG = "A" * 130
"""A name whose module has a name of 263 bytes."""


@pytest.mark.parametrize("name", [f"msg/{LONG}.msg", f"srv/{LONG}.srv"])
def test_a_definition_whose_file_would_have_a_long_name_is_refused(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    definitions("Rpm")
    build()
    before = identity(Path("generated"))
    write_definitions(Path("in"), {name: STAMP if name.startswith("msg") else f"{STAMP}---\n{STAMP}"})
    for option in ((), ("--check",)):
        assert build(*option) == 2
        shown = capsys.readouterr().err
        assert f"in/{name}" in shown
        assert "S125 the name '_a_a_a" in shown
        assert "the limit of the disk is 255" in shown
    assert identity(Path("generated")) == before
    Path("in", name).unlink()
    assert build() == 0


def test_a_package_of_ros_with_a_long_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    write_definitions(Path("other"), {"msg/Point.msg": "float64 x\n"})
    assert main(["build", "-q", "--msg-dir", f"{'p' * 300}=other"]) == 2
    assert "other/msg/Point.msg: S125 the name 'ppp" in capsys.readouterr().err
    assert not Path("generated").exists()


@pytest.mark.parametrize("output", [("--package", "p" * 3000), ("-o", "p" * 300), ("-o", "p/" * 3000)])
def test_an_output_with_a_long_name_is_refused(output: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    assert build(*output) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("--output: S125 ")
    assert len(shown.splitlines()[0]) < 200
    assert os.listdir() == ["in"]


def test_a_path_that_is_too_long_only_for_a_file_of_no_definition_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    definitions("Rpm")
    folder = "/".join(["p" * 200] * 20)
    folder += "/" + "p" * (4095 - len("//px4_types/encapsulation") - len(folder))
    assert build("-o", folder) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("--output: S125 the path 'ppp")
    assert "has 4098 bytes, the limit of the system is 4095" in shown
    assert os.listdir() == ["in"]


@pytest.mark.parametrize("name", ["n" * 300, "n/" * 3000 + "n"])
def test_a_rendered_file_with_a_long_name_is_refused(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    Path("any.h.j2").write_text("{{ message.name }}\n")
    assert main(["render", "--px4", "in", "--template", "any.h.j2", "-o", "out", "--name", name]) == 2
    assert capsys.readouterr().err.startswith("--name: T206 the ")
    assert not Path("out").exists()


def test_the_limit_of_the_disk_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "pathconf", lambda _, key: {"PC_NAME_MAX": 143, "PC_PATH_MAX": 4096}[key], raising=False)
    assert [name for name, _ in too_long("out", ["a" * 143, "b" * 144])] == ["b" * 144]
    monkeypatch.delattr(os, "pathconf")
    assert [name for name, _ in too_long("out", ["a" * 255, "ä" * 128])] == ["ä" * 128]


@pytest.mark.parametrize(
    "name", [f"msg/_{'a_' * 130}.py", "x/" * 2100 + "y", "cdr.py/none", "msg", "lines", "fifo", "msg/__pycache__"]
)
def test_an_entry_of_the_record_that_cannot_be_removed_heals(name: str) -> None:
    definitions("Rpm", "Fan")
    build()
    (PACKAGE / "msg/__pycache__").mkdir()
    (PACKAGE / "msg/__pycache__/own").touch()
    os.mkfifo(PACKAGE / "fifo")
    record_more({name: digest("mine")})
    definitions("Rpm")
    assert build() == 0
    assert name not in json.loads((PACKAGE / RECORD).read_text())["files"]
    assert build("--check") == 0


# --- The user's files, links and permissions


@pytest.mark.skipif(sys.platform != "linux", reason="folders are swapped on Linux")
def test_what_is_the_users_stays_as_it_is_when_the_package_is_swapped() -> None:
    definitions("Rpm")
    build()
    before_swap = PACKAGE.stat().st_ino
    own = {"notes.txt": "mine", "msg/__pycache__/_rpm.pyc": "compiled", "tools/deep/own.py": "mine = 1\n", ".env": "x"}
    write_definitions(PACKAGE, own)
    (PACKAGE / "tools/link").symlink_to("../cdr.py")
    (PACKAGE / "outside").symlink_to("/nowhere")
    (PACKAGE / "tools/deep").chmod(0o555)
    PACKAGE.chmod(0o750)
    before = identity(PACKAGE)
    definitions("Fan", "Lamp")
    assert build() == 0
    after = identity(PACKAGE)
    assert PACKAGE.stat().st_ino != before_swap
    assert {name: after[name] for name in own} == {name: before[name] for name in own}
    assert {name: after[name] for name in ("cdr.py", "py.typed")} == {
        name: before[name] for name in ("cdr.py", "py.typed")
    }
    assert os.readlink(PACKAGE / "tools/link") == "../cdr.py"
    assert os.readlink(PACKAGE / "outside") == "/nowhere"
    assert (PACKAGE / "tools/deep").stat().st_mode & 0o777 == 0o555
    assert PACKAGE.stat().st_mode & 0o777 == 0o750
    assert os.listdir("generated") == ["px4_types"]


def test_a_file_that_the_user_saves_during_the_build_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    definitions("Rpm")
    build()
    write_definitions(PACKAGE, {"notes.txt": "old"})
    swap_folders = swap.swap_folders

    def saved_meanwhile(folders: Any) -> list[str]:
        write_definitions(PACKAGE, {"more/new.txt": "mine", "notes.new": "new"})
        os.replace(PACKAGE / "notes.new", PACKAGE / "notes.txt")
        return swap_folders(folders)

    monkeypatch.setattr(swap, "swap_folders", saved_meanwhile)
    definitions("Fan", "Lamp")
    assert build() == 0
    assert (PACKAGE / "more/new.txt").read_text() == "mine"
    assert (PACKAGE / "notes.txt").read_text() == "new"


def test_a_build_from_within_the_package_leaves_the_folder_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    definitions("Rpm")
    build()
    definitions("Fan", "Lamp")
    source = Path("in").resolve()
    monkeypatch.chdir(PACKAGE)
    before = Path().stat().st_ino
    assert main(["build", "-q", "--px4", str(source), "-o", ".."]) == 0
    assert Path("../px4_types").stat().st_ino == before
    assert Path("msg/_lamp.py").exists()


@pytest.mark.parametrize("call", ["link", "chown", "symlink", "mkdir"])
def test_where_the_folder_cannot_be_swapped_its_files_are_replaced(call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As without hard links, with a folder of another user, or in a parent that cannot be written to."""
    definitions("Rpm")
    build()
    write_definitions(PACKAGE, {"notes.txt": "mine"})
    definitions("Fan", "Lamp")
    before = PACKAGE.stat().st_ino
    working = getattr(os, call)

    def refuse(path: Any, *more: Any, **options: Any) -> Any:
        if ".px4_types.msggen-stage" in str(path):
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        return working(path, *more, **options)

    (PACKAGE / "link").symlink_to("notes.txt")
    with monkeypatch.context() as context:
        if call == "chown":
            context.setattr(swap, "_copy_access", lambda _, copy: refuse(copy))
        elif call in ("link", "symlink"):
            context.setattr(os, call, lambda _, path: refuse(path))
            context.setattr(swap, "link_or_copy", lambda _, path: refuse(path))
        else:
            context.setattr(os, call, refuse)
        assert build() == 0
    assert PACKAGE.stat().st_ino == before
    assert build("--check") == 0
    assert os.listdir("generated") == ["px4_types"]


# --- Failing calls, and the order of calls


@pytest.mark.slow
@pytest.mark.parametrize("how", ["swapped", "file by file"])
def test_whichever_call_fails_nothing_is_torn_or_lost(
    how: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if how == "file by file":
        monkeypatch.setattr(swap, "_renameat2", lambda: None)
    own = {"notes.txt": "mine", "more/own.py": "mine = 1\n"}
    definitions("Rpm", "Fan")
    build()
    write_definitions(PACKAGE, own)
    shutil.copytree("generated", "old")
    definitions("Fan", "Lamp", "Horn")
    build()
    old, new = code(Path("old/px4_types")), code()
    outcomes = set()
    for number in itertools.count(0, 6 // examples(6, by_day=1)):  # by day every sixth call
        shutil.rmtree("generated")
        shutil.copytree("old", "generated")
        capsys.readouterr()
        made = itertools.count()

        def full(_: str, made: Iterator[int] = made, number: int = number) -> None:
            if next(made) == number:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        with hooked(full):
            outcome = build()
        if next(made) <= number:
            break
        told = capsys.readouterr().err
        found = code()
        if how == "swapped":
            assert found in (old, new), number
        assert all(data in (old.get(name), new.get(name)) for name, data in found.items()), number
        assert {name: found[name] for name in own} == {name: new[name] for name in own}, number
        assert found == new or outcome == 2, number
        assert outcome == 0 or told.startswith("msggen: "), number
        assert "No space left" in told or outcome == 0, number
        assert build() == 0
        assert code() == new, number
        assert sorted(os.listdir("generated")) == ["px4_types"], number
        outcomes.add(outcome)
    assert outcomes == {0, 2}
    assert number > 30


@pytest.mark.skipif(sys.platform != "linux", reason="folders are swapped on Linux")
def test_everything_is_on_the_disk_before_the_swap(monkeypatch: pytest.MonkeyPatch) -> None:
    definitions("Rpm")
    build()
    calls: list[str] = []
    fsync, exchange = os.fsync, swap._exchange

    def flushed(handle: int) -> None:
        calls.append(os.path.relpath(os.readlink(f"/proc/self/fd/{handle}")))
        fsync(handle)

    def swapped(*arguments: Any) -> None:
        calls.append("swap")
        exchange(*arguments)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(swap, "_exchange", swapped)
    inodes = {name: state[0] for name, state in identity(PACKAGE).items()}
    definitions("Rpm", "Fan")
    assert build() == 0
    now = identity(PACKAGE)
    changed = [name for name in code() if (PACKAGE / name).is_file() and now[name][0] != inodes.get(name)]
    built = str(SIBLING / "new/px4_types")
    expected = {f"{built}/{name}" for name in (*changed, RECORD)} | {built, f"{built}/msg", f"{built}/{CACHE}"}
    before, after = calls[: calls.index("swap")], calls[calls.index("swap") + 1 :]
    assert {*before} == expected
    assert len(before) == len(expected)
    folders = [index for index, name in enumerate(before) if not Path(name).suffix]
    assert min(folders) > max(index for index, name in enumerate(before) if name.endswith(".py"))
    assert after[0] == "generated"


@pytest.mark.skipif(sys.platform != "linux", reason="needs syncfs")
def test_many_files_are_flushed_in_one_call_before_the_package_appears(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    flush, fsync, rename = files._flush_file_system, os.fsync, os.rename
    monkeypatch.setattr(files, "_flush_file_system", lambda path: calls.append("all") or flush(path))  # type: ignore[func-returns-value]
    monkeypatch.setattr(os, "fsync", lambda handle: calls.append("one") or fsync(handle))  # type: ignore[func-returns-value]
    monkeypatch.setattr(os, "rename", lambda *paths: calls.append("rename") or rename(*paths))  # type: ignore[func-returns-value]
    definitions("Rpm")
    assert build() == 0
    assert calls == ["all", "rename", "one"]
    calls.clear()
    monkeypatch.setattr(files, "_flush_file_system", lambda _: False)
    assert build("-o", "other") == 0
    number = len([path for path in Path("other/px4_types").rglob("*") if CACHE not in str(path)]) + 1
    assert calls == [*["one"] * number, "rename", "one"]


def test_a_build_of_many_messages_takes_a_constant_number_of_calls_for_each() -> None:
    """One message is replaced by another. The time is linear in the number of messages, as the number of calls is."""
    counts = []
    for number in (50, 100, 200):
        names = [f"Thing{index}" for index in range(number)]
        definitions(*names)
        assert build("-o", str(number)) == 0
        definitions(*names[1:], "Other")
        steps = itertools.count()

        def step(*_: object, steps: Iterator[int] = steps) -> None:
            next(steps)

        sys.setprofile(step)
        try:
            assert build("-o", str(number)) == 0
        finally:
            sys.setprofile(None)
        counts.append(next(steps))
    first, second = counts[1] - counts[0], counts[2] - counts[1]
    assert second < 2.2 * first  # twice the messages were added


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_builds_at_once_wait_although_the_folder_is_swapped() -> None:
    for name, messages in (("few", ("Rpm",)), ("many", ("Rpm", "Fan", "Lamp"))):
        definitions(*messages)
        shutil.copytree("in", name)
        assert main(["build", "-q", "--px4", name, "-o", f"only_{name}"]) == 0
    children = []
    for name in ("few", "many") * 6:
        child = os.fork()
        if child == 0:
            os._exit(main(["build", "-q", "--px4", name, "-o", "generated"]))
        children.append(child)
    assert {os.waitpid(child, 0)[1] for child in children} == {0}
    assert content(Path("generated")) in (content(Path("only_few")), content(Path("only_many")))


@pytest.mark.parametrize("arguments", [["build", "--px4", "in"], ["render", "--template", "a.txt.j2", "--px4", "in"]])
@pytest.mark.parametrize("output", ["out", "out/inner"])
def test_a_link_on_the_way_to_the_output_is_refused(
    arguments: list[str], output: str, capsys: pytest.CaptureFixture[str]
) -> None:
    definitions("Rpm")
    write_definitions(Path(), {"a.txt.j2": "{{ message.name }}\n", "victim/rpm.txt": "precious\n"})
    os.symlink("victim", "out")
    before = content(Path("victim"))
    assert main([*arguments, "-o", output]) == 2
    assert "out: S115 symbolic link to victim" in capsys.readouterr().err
    assert content(Path("victim")) == before
    assert main([*arguments, "-o", os.path.abspath(output)]) == (
        0 if output == "out/inner" or "build" in arguments else 2
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes in folders")
def test_a_pipe_or_a_device_is_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    definitions("Rpm")
    write_definitions(Path(), {"a.txt.j2": "{{ message.name }}\n"})
    os.mkdir("out")
    os.mkfifo("out/rpm.txt")
    assert main(["render", "--template", "a.txt.j2", "--px4", "in", "-o", "out"]) == 2
    assert "rpm.txt: S104 not a regular file" in capsys.readouterr().err
    assert Path("out/rpm.txt").is_fifo()
