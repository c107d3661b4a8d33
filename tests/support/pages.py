"""Pages whose commands and code run one after the other, from an empty folder, as a reader copies them.

The first command of such a page is the `pip install` of all that it needs. A block of commands has what they print below
them, on both streams; a block of code has it in the block of text that follows. `...` in a line of its own stands for
any lines of a command. `<!-- needs: NAME -->` before a block leaves it to the tests that have this package.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, NamedTuple

from support.page_python import END
from support.repository import ROOT

_BLOCK = re.compile(
    r"^(?:<!-- needs: (?P<needs>\w+) -->\n\n)?```(?P<kind>console|python|pycon)\n(?P<text>.*?)^```"
    r"(?:\n\n```text\n(?P<output>.*?)^```)?",
    re.MULTILINE | re.DOTALL,
)
_COMMAND = re.compile(r"^\$ (.+)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
INSTALL = "pip install "
PORT = 8888
"""The port of the agent on the pages."""


class Step(NamedTuple):
    """What a reader copies, and what the page shows below it."""

    kind: str
    """`console`, `python`, or `pycon` for code with prompts."""
    code: str
    shown: str
    needs: str | None = None
    """A package without which it is left out."""


def steps_of(page: str) -> list[Step]:
    """Return the commands and the code on a page of `docs`, in their order."""
    return list(_steps((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")))


def _steps(text: str) -> Iterator[Step]:
    for block in _BLOCK.finditer(text):
        kind, content, needs = block["kind"], block["text"], block["needs"]
        if kind == "console":
            yield from (Step(kind, code, shown, needs) for code, shown in _COMMAND.findall(content))
        else:
            yield Step(kind, content, content if kind == "pycon" else block["output"] or "", needs)


# What differs from run to run

_CHANGING = (
    (re.compile(r"\d{4}-\d\d-\d\d[ T_]\d\d[:-]\d\d[:-]\d\d(\.\d+)?(\+00:00)?"), "TIME"),
    (re.compile(r"\b\d{4}-\d\d-\d\d\b"), "DATE"),
    (re.compile(r"\b\d\d:\d\d:\d\d(\.\d+)?\b"), "TIME"),
    (re.compile(r"(?<=-)[0-9a-f]{8}\b"), "DIGEST"),
    (re.compile(r"(?<![\w-])1[5-9]\d{8,}(\.\d+)?"), "TIME"),
    (re.compile(r"[\d,]+(\.\d+)? (B|kB|MB|GB|bytes)\b"), "SIZE"),
    (re.compile(r"\bbyte \d+"), "OFFSET"),
    (re.compile(r"\bin \d+(\.\d+)? s\b"), "in SECONDS"),
    (re.compile(r"^building the types of .*\n", re.MULTILINE), ""),
    (re.compile(r"[ \t]+"), " "),
    (re.compile(r" +$", re.MULTILINE), ""),
)
"""Dates, sizes and times, digests and places in files, which depend on them, and how wide that makes a table."""
_NUMBER = re.compile(r"[\d.,:]*\d")


def normalised(text: str, *, is_live: bool = False) -> str:
    """Return an output without what differs from run to run. If it is of a live vehicle, that is all numbers."""
    for pattern, name in _CHANGING:
        text = pattern.sub(name, text)
    return _NUMBER.sub("N", text) if is_live else text


def matches(shown: str, printed: str) -> bool:
    """Return whether an output is what a page shows, where `...` stands for any lines."""
    lines = (r"(?:.*\n)*?" if line == "...\n" else re.escape(line) for line in shown.splitlines(keepends=True))
    return re.fullmatch("".join(lines), printed) is not None


# Running


class Reader:
    """Copies the steps of a page, one after the other, into a shell and into Python."""

    def __init__(self, folder: Path, variables: Mapping[str, str], port: int = PORT) -> None:
        self.folder = folder
        self._port = str(port)
        self._shell = _start(["bash", "--norc", "--noprofile"], folder, variables)
        self._python: subprocess.Popen[str] | None = None

    def run(self, step: Step) -> str:
        """Run a step, and return what it prints."""
        if step.kind == "console":
            return self._command(step.code)
        if self._python is None:
            self._python = self._started()
        block = {"code": step.code, "has_prompts": step.kind == "pycon"}
        return _answer(self._python, json.dumps(block) + "\n")

    def _command(self, command: str) -> str:
        command = command.replace(str(PORT), self._port)
        end = f"printf {shlex.quote(END)}"
        return _answer(self._shell, f"{{ {command}\n}} </dev/null\n{end}\n").replace(self._port, str(PORT))

    def _started(self) -> subprocess.Popen[str]:
        """Start Python with the variables that the shell has."""
        lines = self._command("env -0").split("\0")
        variables = dict(line.split("=", 1) for line in lines if "=" in line)
        return _start(["python", "-u", str(ROOT / "tests" / "support" / "page_python.py")], self.folder, variables)

    def close(self) -> None:
        """End both, and all that they have started."""
        for process in filter(None, (self._python, self._shell)):
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            with process:  # which closes its pipes
                pass


def _start(command: list[str], folder: Path, variables: Mapping[str, str]) -> subprocess.Popen[str]:
    path = variables.get("PATH", os.defpath).split(os.pathsep)
    program = next((each for each in (Path(part, command[0]) for part in path) if each.exists()), Path(command[0]))
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return subprocess.Popen(
        [str(program), *command[1:]], cwd=folder, env=variables, text=True, start_new_session=True, **pipes
    )


def _answer(process: subprocess.Popen[str], text: str) -> str:
    """Send a text, and return what is printed up to END."""
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None
    assert stdout is not None
    stdin.write(text)
    stdin.flush()
    return "".join(_until_end(stdout))


def _until_end(stream: IO[str]) -> Iterator[str]:
    while (letter := stream.read(1)) != END:
        assert letter, "the program has ended"
        yield letter


@contextmanager
def reading(folder: Path, variables: Mapping[str, str], port: int = PORT) -> Iterator[Reader]:
    """Return a reader in a folder, and end what it has started."""
    reader = Reader(folder, variables, port)
    try:
        yield reader
    finally:
        reader.close()


def environment(programs: Path, folder: Path, **more: str) -> dict[str, str]:
    """Return the variables of a user who has the programs in a folder. Files of the user are below `folder`."""
    folder.mkdir(exist_ok=True)
    kept = {
        name: os.environ[name] for name in ("LANG", "PATH", "PIP_INDEX_URL", "PIP_CONFIG_FILE") if name in os.environ
    }
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    return {**kept, "HOME": str(folder), "PATH": path, "TMPDIR": str(folder), "MSGGEN_RUNTIME": str(folder), **more}


def check_page(
    page: str,
    reader: Reader,
    *,
    is_live: bool = False,
    packages: Collection[str] = (),
    install: Callable[[str], object] = lambda _: None,
) -> None:
    """Run the steps of a page, and check that each prints what the page shows.

    `install` is called with the arguments of each `pip install`, and `packages` are those that blocks of code need.
    """
    for step in steps_of(page):
        if step.needs and step.needs not in packages:
            continue
        if step.code.startswith(INSTALL):
            install(step.code.removeprefix(INSTALL))
            continue
        shown, printed = (normalised(text, is_live=is_live) for text in (step.shown, reader.run(step)))
        if not matches(shown, printed):
            assert printed == shown, step.code


if __name__ == "__main__":  # prints a page as it runs in the present environment: python -m support.pages PAGE FOLDER
    with reading(Path(sys.argv[2]), dict(os.environ)) as shown_reader:
        for shown_step in steps_of(sys.argv[1]):
            if not shown_step.code.startswith(INSTALL):
                print(f"$ {shown_step.code}\n{shown_reader.run(shown_step)}", flush=True)
