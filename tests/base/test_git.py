"""No program of a repository runs, whatever its configuration names."""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from threading import Timer

import pytest

from msggen.base.disk.git import GitError, commit_of, status
from msggen.cli import main
from support.examples import by_day
from support.packages import committed
from support.packages import git as run

PROGRAMS = (
    "alias.status",
    "core.alternateRefsCommand",
    "core.askPass",
    "core.editor",
    "core.fsmonitor",
    "core.gitProxy",
    "core.pager",
    "core.sshCommand",
    "credential.helper",
    "diff.external",
    "diff.mark.command",
    "diff.mark.textconv",
    "filter.mark.clean",
    "filter.mark.process",
    "filter.mark.smudge",
    "gpg.program",
    "interactive.diffFilter",
    "merge.mark.driver",
    "pager.cat-file",
    "pager.describe",
    "pager.for-each-ref",
    "pager.ls-tree",
    "pager.status",
    "remote.origin.receivepack",
    "remote.origin.uploadpack",
    "sequence.editor",
    "submodule.inner.update",
    "trailer.mark.cmd",
    "trailer.mark.command",
    "uploadpack.packObjectsHook",
)
"""The keys of a configuration whose value git runs."""

HOOKS = ("post-index-change", "pre-auto-gc", "post-checkout", "reference-transaction", "fsmonitor-watchman")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def mark() -> Path:
    """A program that leaves a mark when it runs: the file `ran`."""
    program = Path("mark").absolute()
    program.write_text(f'#!/bin/sh\necho "$0 $*" >> {program.with_name("ran")}\ncat\n')
    program.chmod(0o755)
    return program


@pytest.mark.parametrize("way", ["", ".", "bin", "here"])
def test_the_git_of_the_current_folder_does_not_run(way: str, mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On Windows, it would also run with no such folder on the PATH."""
    for folder in (Path(), Path("bin")):
        folder.mkdir(exist_ok=True)
        shutil.copy(mark, folder / "git")
        shutil.copy(mark, folder / "git.exe")
    repository("firmware", {"msg/Lamp.msg": "uint64 timestamp\n"})
    here = os.getcwd() if way == "here" else way
    monkeypatch.setenv("PATH", here + os.pathsep + os.environ["PATH"])
    assert len(commit_of("firmware", "HEAD")) == 40
    assert not Path("ran").exists()


def test_a_program_that_cannot_run_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        Path(name).mkdir()
    Path("a/git").write_text("")
    Path("b/git").mkdir()
    monkeypatch.setenv("PATH", os.pathsep.join(os.path.abspath(name) for name in ("a", "b", "c")))
    with pytest.raises(GitError, match="the program 'git' is not installed"):
        commit_of(".", "HEAD")


def repository(folder: str, files: dict[str, str]) -> None:
    for name, text in files.items():
        Path(folder, name).parent.mkdir(parents=True, exist_ok=True)
        Path(folder, name).write_text(text)
    committed(Path(folder))


def set_hostile(folder: str, mark: Path) -> None:
    """Name `mark` everywhere in the configuration of a repository, in an included file and as every hook."""
    hooks = Path(folder, "hooks").absolute()
    hooks.mkdir()
    for hook in HOOKS:
        shutil.copy(mark, hooks / hook)
        shutil.copy(mark, Path(folder, ".git/hooks", hook))
    included = Path(folder, ".git", "more").absolute()
    included.write_text("".join(setting(key, mark) for key in PROGRAMS))
    run(Path(folder), "config", "core.hooksPath", str(hooks))
    run(Path(folder), "config", "filter.mark.required", "true")
    run(Path(folder), "config", "remote.origin.url", os.path.abspath(folder))
    run(Path(folder), "config", "remote.origin.promisor", "true")
    run(Path(folder), "config", "core.repositoryFormatVersion", "1")
    run(Path(folder), "config", "extensions.partialClone", "origin")
    run(Path(folder), "config", "protocol.allow", "always")
    run(Path(folder), "config", f"includeIf.gitdir:{os.path.abspath(folder)}/.path", str(included))
    Path(folder, ".git/info/attributes").write_text("* filter=mark diff=mark merge=mark\n")


def setting(key: str, mark: Path) -> str:
    """Return the lines of a configuration that set `key`, without a process of git for each."""
    section, _, rest = key.partition(".")
    subsection, _, name = rest.rpartition(".")
    header = f'{section} "{subsection}"' if subsection else section
    return f"[{header}]\n\t{name} = {'!' * key.startswith(('alias', 'sub'))}{mark}\n"


def lose(folder: str, name: str) -> None:
    """Remove an object, as in a partial clone."""
    object_ = run(Path(folder), "rev-parse", f"HEAD:{name}")
    os.unlink(os.path.join(folder, ".git/objects", object_[:2], object_[2:]))


FIRMWARE = {"msg/Gripper.msg": "uint64 timestamp\n", "msg/Hand.msg": "uint64 timestamp\nfloat32 force\n"}
PACKAGE = {"package.xml": "<package><name>px4_msgs</name></package>", "msg/Gripper.msg": "uint64 timestamp\nuint8 id\n"}

COMMANDS = (
    ["build", "--px4", "firmware@HEAD"],
    ["build", "--px4", "firmware"],
    ["sync", "--px4", "firmware", "px4_msgs"],
    ["sync", "--px4", "firmware@HEAD", "px4_msgs", "--check"],
    ["check", "--px4", "firmware@HEAD", "px4_msgs@HEAD"],
    ["breaking", "--px4", "firmware", "--against", "HEAD"],
    ["bump", "--px4", "firmware", "--against", "HEAD", "Gripper"],
    ["render", "--px4", "firmware@HEAD", "--template", "a.txt.j2", "-o", "out"],
)


@by_day(
    ("command", "partial"),
    [(command, bool(place % 2) == first) for place, command in enumerate(COMMANDS) for first in (True, False)],
    2,
)  # by day each command once
def test_no_command_runs_a_program_of_a_repository(command: list[str], mark: Path, partial: bool) -> None:  # noqa: FBT001 - pytest passes it
    repository("firmware", FIRMWARE)
    repository("px4_msgs", PACKAGE)
    Path("a.txt.j2").write_text("")
    for folder in ("firmware", "px4_msgs"):
        if partial:
            lose(folder, "msg/Gripper.msg")
        set_hostile(folder, mark)
        os.utime(Path(folder, "msg/Gripper.msg"), (1, 1))  # so that git compares its content
    assert main(command) in (0, 1, 2)
    assert not Path("ran").exists(), Path("ran").read_text()


def test_the_programs_would_run_without_these_precautions(mark: Path) -> None:
    repository("firmware", FIRMWARE)
    set_hostile("firmware", mark)
    os.utime("firmware/msg/Gripper.msg", (1, 1))
    subprocess.run(["git", "-C", "firmware", "status"], capture_output=True, check=False)
    assert Path("ran").exists()


def test_a_partial_clone_is_told_how_it_is_completed(capsys: pytest.CaptureFixture[str]) -> None:
    repository("firmware", FIRMWARE)
    lose("firmware", "msg/Hand.msg")
    assert main(["build", "--px4", "firmware@HEAD"]) == 2
    said = capsys.readouterr().err
    assert "firmware@HEAD: S108 object" in said
    assert "git fetch --refetch" in said


def test_a_filter_does_not_hide_or_invent_a_change(mark: Path) -> None:
    repository("firmware", FIRMWARE)
    set_hostile("firmware", mark)
    os.utime("firmware/msg/Gripper.msg", (1, 1))
    assert status("firmware", "--", "msg") == b""
    Path("firmware/msg/Gripper.msg").write_text("uint64 timestamps\n")
    assert status("firmware", "--", "msg") == b" M msg/Gripper.msg\n"


def test_a_filter_that_cannot_be_turned_off_is_refused(mark: Path) -> None:
    repository("firmware", FIRMWARE)
    run(Path("firmware"), "config", "filter.a=b.clean", str(mark))
    with pytest.raises(GitError, match="filter with '='"):
        status("firmware")


@pytest.mark.parametrize("call", [lambda: status("firmware"), lambda: commit_of("firmware", "HEAD")])
def test_what_git_prints_is_bounded(call: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    repository("firmware", FIRMWARE)
    Path("firmware/more").write_text("")
    monkeypatch.setattr("msggen.base.disk.git._LARGEST_OUTPUT", 1)
    with pytest.raises(GitError):
        call()


def test_a_large_file_of_a_revision_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    repository("firmware", {**FIRMWARE, "msg/Large.msg": "#" * (2**24 + 1)})
    assert main(["build", "--px4", "firmware@HEAD"]) == 2
    assert "S108 'msg/Large.msg' is larger than 16 MiB, the limit for a file" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes in folders")
def test_a_pipe_in_place_of_the_configuration_stops_git(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(tmp_path, "init", "-q")
    (tmp_path / ".git/config").unlink()
    os.mkfifo(tmp_path / ".git/config")
    monkeypatch.setattr("msggen.base.disk.git.SECONDS", 1)
    with pytest.raises(GitError, match="does not finish within 1 s"):
        status(str(tmp_path))


def test_an_interruption_does_not_wait_for_the_time_limit(mark: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C can come at once after the clock has started. The program would then last until the limit."""
    started: list[Timer] = []

    class Interrupted(Timer):
        def start(self) -> None:
            super().start()
            started.append(self)
            raise KeyboardInterrupt

    monkeypatch.setattr("msggen.base.disk.git.Timer", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        status(str(mark.parent))
    (clock,) = started
    assert clock.daemon
    assert clock.finished.is_set()
