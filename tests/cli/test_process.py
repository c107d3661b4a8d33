"""Tests of msggen as a process: Ctrl-C at any moment, colours, and the command line without a command."""

from __future__ import annotations

import os
import pty
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from msggen.base.version import __version__
from support.catalogs import write_definitions
from support.examples import by_day, examples
from support.repository import ROOT

PROGRAM = """
import sys
sys.path.insert(0, sys.argv.pop(1))
import msggen.__main__ as program
print(end="started", file=sys.stderr, flush=True)
sys.exit(program.main())
"""
"""Runs msggen, and says so once Ctrl-C is for msggen and no longer for the start of Python."""

TREE = {
    "fw/msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\n",
    "fw/msg/Bulb.msg": "uint64 timestamp\nfloat32 heat\n",
    "fw/msg/translation_node/translations/all_translations.h": "#pragma once\n",
    "fw/src/modules/README": "",
    "old/msg/versioned/Lamp.msg": "uint32 MESSAGE_VERSION = 0\nuint64 timestamp\nuint8 x\n",
    "old/msg/Bulb.msg": "uint64 timestamp\n",
    "name.txt.j2": "{{ message.name }}\n",
}
COMMANDS = (
    "build -o made",
    "build -o made --check --diff",
    "build --px4 fw@HEAD -o made",
    "sync --create px4_msgs",
    "check old fw",
    "check old fw --output-format sarif",
    "check old fw --output-format junit",
    "breaking --px4 fw --against HEAD",
    "bump Lamp --px4 fw",
    "render --template name.txt.j2 -o made",
    "px4-generate --headers",
    "releases",
    "settings",
    "settings --schema",
    "rules",
    "rules --output-format json",
    "explain FIELD_MOVED",
    "explain M301",
    "completion zsh",
    "--help",
    "",
)
MOMENTS = examples(9)


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "msggen", *arguments]
    return subprocess.run(
        command, cwd=folder, env=plain(environment), capture_output=True, text=True, check=False, timeout=60
    )


def plain(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of the tests without the variables that decide on colours, but with `environment`."""
    dropped = {"NO_COLOR", "FORCE_COLOR", "TERM", "PYTHON_COLORS", "COLORTERM", "COLUMNS"}
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return {**kept, "PYTHONPATH": str(ROOT), "TERM": "xterm", **environment}


# --- Ctrl-C


def git(folder: Path, *arguments: str) -> None:
    author = ["-c", "user.name=tester", "-c", "user.email=tester@localhost"]
    subprocess.run(["git", *author, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.mark.slow
@pytest.mark.tools("git")
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
@by_day("command", COMMANDS, 4)
def test_ctrl_c_is_exit_130_without_a_trace_at_any_moment(command: str, tmp_path: Path) -> None:
    write_definitions(tmp_path, TREE)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-q", "-m", "all")
    moments = random.Random(command)  # noqa: S311 - the moments need not be secret
    before = time.monotonic()
    whole = interrupted(tmp_path, command, None)
    longest = time.monotonic() - before
    for _ in range(MOMENTS):
        for made in ("made", "px4_msgs"):
            shutil.rmtree(tmp_path / made, ignore_errors=True)
        git(tmp_path, "reset", "-q", "--hard")
        done = interrupted(tmp_path, command, moments.uniform(0, longest))
        assert done.returncode in (130, whole.returncode), done
        assert "Traceback" not in done.stderr, done
        assert "KeyboardInterrupt" not in done.stderr, done
        if done.returncode == 130:
            assert done.stderr.removeprefix("started") in ("", "msggen: interrupted, nothing is half-written\n")


def interrupted(folder: Path, command: str, after: float | None) -> subprocess.CompletedProcess[str]:
    """Run a command, and send SIGINT to its whole group `after` so many seconds, as a terminal does."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(ROOT), *command.split()],
        cwd=folder,
        env=plain({}),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
    )
    assert process.stderr
    started = process.stderr.read(len("started"))
    assert started == "started"
    if after is not None:
        time.sleep(after)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    return subprocess.CompletedProcess(command, process.returncode, out, err)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_ctrl_c_is_exit_130_during_the_imports(tmp_path: Path) -> None:
    """A module that msggen imports first waits for the signal."""
    (tmp_path / "argparse.py").write_text("import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(9)")
    program = PROGRAM.replace("sys.path.insert(0, sys.argv.pop(1))", "sys.path[:0] = ['.', sys.argv.pop(1)]")
    command = [sys.executable, "-c", program, str(ROOT), "build"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=30)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "started")


INTERRUPTED_AT_A_LINE = """
import _signal, linecache, os, runpy, sys

def interrupted_at(number):
    path, count, loaded = os.path.join("msggen", "__main__.py"), 0, ()

    def trace(frame, event, argument):
        nonlocal count, loaded
        if not frame.f_code.co_filename.endswith(path):
            return None
        loaded = loaded or set(sys.modules)
        if event == "line":
            count += 1
            if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
                os.write(1, f"imported early: {set(sys.modules) - loaded or ''}\\n".encode())
            elif count >= number and linecache.getline(frame.f_code.co_filename, frame.f_lineno).strip() != "try:":
                sys.settrace(None)
                os.kill(os.getpid(), _signal.SIGINT)
        return trace

    sys.settrace(trace)
    runpy.run_module("msggen", run_name="__main__", alter_sys=True)

sys.argv = ["msggen", "releases"]
for number in range(1, 99):
    process = os.fork()
    if process == 0:
        interrupted_at(number)
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    os.write(1, f"exit code: {code}\\n".encode())
    if code != 130:
        break
"""
"""Interrupts msggen at each line of its entry point in turn, from the one on that has set the handler.

The lines with `try:` are left out: Python looks for signals at calls and jumps only.
"""


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_ctrl_c_is_exit_130_at_each_line_of_the_start(tmp_path: Path) -> None:
    command = [sys.executable, "-c", INTERRUPTED_AT_A_LINE]
    done = subprocess.run(command, cwd=tmp_path, env=plain({}), capture_output=True, text=True, check=False, timeout=60)
    lines = done.stdout.splitlines()
    codes = [line for line in lines if line.startswith("exit code: ")]
    assert set(codes[:-1]) == {"exit code: 130"}
    assert codes[-1] == "exit code: 0", "it ends without an interrupt only after the last line"
    assert len(codes) > 20
    assert {line for line in lines if line.startswith("imported")} == {"imported early: "}
    assert done.stderr.replace("msggen: interrupted, nothing is half-written\n", "") == ""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
@pytest.mark.parametrize(
    ("where", "told"),
    [
        ("def run(): os.kill(os.getpid(), signal.SIGINT); time.sleep(9)", "interrupted"),
        ("class Odd:\n def __del__(self): os.kill(os.getpid(), signal.SIGINT); time.sleep(9)\ndef run(): Odd()", ""),
        ("def run():\n  atexit.register(os.kill, os.getpid(), signal.SIGINT); return 7", "7"),
        ("def run(): signal.raise_signal(signal.SIGINT); return 7", "interrupted"),
    ],
    ids=["sleeping", "destructor", "exit", "now"],
)
def test_ctrl_c_is_noticed_where_python_would_ignore_it(where: str, told: str) -> None:
    program = f"""
import sys; sys.path.insert(0, {str(ROOT)!r})
import atexit, os, signal, time
import msggen.__main__, msggen.cli
{where}
msggen.cli._run = lambda options: run()
sys.argv[1:] = ["releases"]
sys.exit(msggen.__main__.main())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, timeout=30)
    expected = "msggen: interrupted, nothing is half-written\n" if told == "interrupted" else ""
    assert (done.returncode, done.stderr) == (7 if told == "7" else 130, expected)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_a_program_in_the_background_goes_on(tmp_path: Path) -> None:
    """A shell without job control ignores SIGINT for programs that it starts with `&`."""
    script = (
        f'trap "" INT; "{sys.executable}" -m msggen rules > out & child=$!; sleep 0.05; kill -INT $child; wait $child'
    )
    done = subprocess.run(["sh", "-c", script], cwd=tmp_path, env=plain({}), check=False, timeout=60)
    assert done.returncode == 0
    assert "FIELD_MOVED" in (tmp_path / "out").read_text()


# --- Colours

NO, YES = False, True
COLOURED = (["check", "old", "fw"], ["build", "--msg-dir", "bad"], ["explain", "FIELD_MOVED"])
PLAIN = (["build", "--help"], ["--help"], ["build", "--nonsense"])
"""Commands with coloured output, and those that argparse answers: the first of each in each run, all at night."""


@pytest.mark.slow
@pytest.mark.parametrize("terminal", [False, True])
@by_day(
    ("environment", "expected"),
    [
        ({}, None),
        ({"NO_COLOR": ""}, None),
        ({"FORCE_COLOR": ""}, None),
        ({"NO_COLOR": "1"}, NO),
        ({"TERM": "dumb"}, NO),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, NO),
        ({"FORCE_COLOR": "1"}, YES),
        ({"FORCE_COLOR": "1", "TERM": "dumb"}, YES),
    ],
    3,
)
def test_one_rule_decides_on_colours_of_all_output(
    environment: dict[str, str], *, expected: bool | None, terminal: bool, tmp_path: Path
) -> None:
    wanted = terminal if expected is None else expected
    write_definitions(tmp_path, {**TREE, "bad/Odd.msg": "uint64 timestamp\nfloat3 x\n"})
    for arguments in COLOURED[: examples(3)]:
        shown = (
            run_in_terminal(tmp_path, arguments, environment)
            if terminal
            else "".join((done := run(tmp_path, *arguments, **environment)).stdout + done.stderr)
        )
        assert ("\x1b[" in shown) == wanted, (arguments, shown)
    for arguments in PLAIN[: examples(3)]:
        shown = (
            run_in_terminal(tmp_path, arguments, environment)
            if terminal
            else run(tmp_path, *arguments, **environment).stdout
        )
        assert "\x1b[" not in shown or (wanted and sys.version_info >= (3, 14))


def run_in_terminal(folder: Path, arguments: list[str], environment: Mapping[str, str]) -> str:
    """Return what msggen prints to a terminal."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "msggen", *arguments]
    with subprocess.Popen(command, cwd=folder, env=plain(environment), stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                more = os.read(ours, 65536)
            except OSError:  # Linux reports the end of the output as an error
                break
            if not more:
                break
            shown += more
        process.wait(timeout=60)
    os.close(ours)
    return shown.decode()


# --- Without a command


@pytest.mark.slow
def test_msggen_alone_shows_its_help_and_exits_with_2(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == run(tmp_path, "--help").stdout
    assert re.search(r"(?m)^ +build ", done.stderr)


@pytest.mark.slow
@pytest.mark.parametrize("option", ["-V", "--version"])
def test_the_version_is_shown(option: str, tmp_path: Path) -> None:
    done = run(tmp_path, option)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"msggen {__version__}\n", "")


# --- Closed and full streams


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@by_day(
    ("command", "code"),
    [
        ("rules", 0),
        ("check old nowhere --output-format json", 2),
        ("build --px4 nowhere", 2),
        ("check old fw", 1),
        ("build --nonsense", 2),
        ("", 2),
        ("build --help", 0),
    ],
    4,
)
def test_a_closed_or_full_stream_changes_no_exit_code_and_gives_no_trace(
    command: str, code: int, tmp_path: Path
) -> None:
    write_definitions(tmp_path, TREE)
    for streams, others in (
        (">&- 2>err", ()),
        ("2>&- >err", ()),
        (">&- 2>&-", ()),
        ("2>/dev/full >err", ()),
        (">/dev/full 2>err", (2,)),
    ):
        script = f'"{sys.executable}" -m msggen {command} {streams}'
        done = subprocess.run(["sh", "-c", script], cwd=tmp_path, env=plain({}), check=False, timeout=60)
        assert done.returncode in (code, *others), streams
        written = tmp_path / "err"
        assert not written.exists() or "Traceback" not in written.read_text()
