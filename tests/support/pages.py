"""Pages whose commands and code run one after the other, from an empty folder, as a reader copies them.

The first command of such a page is the `pip install` of all that it needs. A block of commands has what they print
below them, on both streams; a block of code has it in the block of text that follows. `...` in a line of its own stands
for any lines of a command. `<!-- needs: NAME -->` before a block leaves it to the tests that have this package.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Timer
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
_BENCHMARK = "python benchmarks/"
"""A command that needs a clone of the repository, and takes minutes."""
PORTS = (8888, 5000)
"""The ports on the pages: of the agent, and of a store."""


class Step(NamedTuple):
    """What a reader copies, and what the page shows below it."""

    kind: str
    """`console`, `python`, or `pycon` for code with prompts."""
    code: str
    shown: str
    needs: str | None = None
    """A package without which it is left out."""


def steps_of(page: str, section: str = "") -> list[Step]:
    """Return the commands and the code on a page of `docs`, or in a section of it, in their order."""
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    if section:
        text = text.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    return list(_steps(text))


def _steps(text: str) -> Iterator[Step]:
    for block in _BLOCK.finditer(text):
        kind, content, needs = block["kind"], block["text"], block["needs"]
        if kind == "console":
            commands = (each for each in _COMMAND.findall(content) if not each[0].startswith(_BENCHMARK))
            yield from (Step(kind, code, shown, needs) for code, shown in commands)
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
    (re.compile(r"^(building the types of|waiting for a vehicle|the vehicle is connected).*\n", re.MULTILINE), ""),
    (re.compile(r"[ \t]+"), " "),
    (re.compile(r" +$", re.MULTILINE), ""),
)
"""Dates, sizes and times, digests and places in files, which depend on them, and how wide that makes a table."""
_LONGEST = 240
"""The longest time in s that a step may take."""
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

    def __init__(self, folder: Path, variables: Mapping[str, str], ports: Sequence[int] = PORTS) -> None:
        self.folder = folder
        self._ports = dict(zip(map(str, PORTS), map(str, ports), strict=True))
        self._shell = _start(["bash", "--norc", "--noprofile"], folder, variables, is_shell=True)
        self._python: subprocess.Popen[str] | None = None

    def run(self, step: Step) -> str:
        """Run a step, and return what it prints."""
        if step.kind == "console":
            answer = self._command(_exchanged(step.code, self._ports))
            return _exchanged(answer, {there: shown for shown, there in self._ports.items()})
        if self._python is None:
            self._python = self._started()
        block = {"code": step.code, "has_prompts": step.kind == "pycon"}
        return _answer(self._python, json.dumps(block) + "\n")

    def _command(self, command: str) -> str:
        """Run a command, with the ports that the page does not tell."""
        return _answer(self._shell, f"{{ {command}\n}} </dev/null\nprintf {shlex.quote(END)}\n")

    def _started(self) -> subprocess.Popen[str]:
        """Start Python with the variables that the shell has."""
        lines = self._command("env -0").split("\0")
        variables = dict(line.split("=", 1) for line in lines if "=" in line)
        program = str(ROOT / "tests" / "support" / "page_python.py")
        return _start(["python", "-u", program], self.folder, variables, is_shell=False)

    def close(self) -> None:
        """End both, and all that they have started."""
        for process in filter(None, (self._python, self._shell)):
            _kill(process)
            with process:  # which closes its pipes
                pass


def _exchanged(text: str, ports: Mapping[str, str]) -> str:
    """Return a text with other ports."""
    return re.sub(r"\b\d{4,5}\b", lambda found: ports.get(found[0], found[0]), text)


def _start(command: list[str], folder: Path, variables: Mapping[str, str], *, is_shell: bool) -> subprocess.Popen[str]:
    """Start a program of the reader's. Of Python, a page shows the output without what libraries log."""
    path = variables.get("PATH", os.defpath).split(os.pathsep)
    program = next((each for each in (Path(part, command[0]) for part in path) if each.exists()), Path(command[0]))
    errors = subprocess.STDOUT if is_shell else subprocess.DEVNULL
    return subprocess.Popen(
        [str(program), *command[1:]],
        cwd=folder,
        env=variables,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        start_new_session=True,
    )


def _answer(process: subprocess.Popen[str], text: str) -> str:
    """Send a text, and return what is printed up to END."""
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None
    assert stdout is not None
    patience = Timer(_LONGEST, _kill, [process])
    patience.start()
    try:
        stdin.write(text)
        stdin.flush()
        return "".join(_until_end(stdout))
    finally:
        patience.cancel()


def _kill(process: subprocess.Popen[str]) -> None:
    """End a process and all that it has started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _until_end(stream: IO[str]) -> Iterator[str]:
    while (letter := stream.read(1)) != END:
        assert letter, "the program has ended, or was too slow"
        yield letter


@contextmanager
def reading(folder: Path, variables: Mapping[str, str], ports: Sequence[int] = PORTS) -> Iterator[Reader]:
    """Return a reader in a folder, and end what it has started."""
    reader = Reader(folder, variables, ports)
    try:
        yield reader
    finally:
        reader.close()


def variables_of(programs: Path, home: Path) -> dict[str, str]:
    """Return the variables of a user who has the programs in a folder, with a home of their own."""
    home.mkdir(exist_ok=True)
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    return {"HOME": str(home), "LANG": "C.UTF-8", "MSGGEN_RUNTIME": str(home), "PATH": path}


def outputs_of(steps: Iterable[Step], reader: Reader, packages: Collection[str] = ()) -> Iterator[tuple[Step, str]]:
    """Run the steps of a page but those that install. Yield each with what it prints.

    `packages` are there, of those that steps need.
    """
    for step in steps:
        if (step.needs is None or step.needs in packages) and not step.code.startswith(INSTALL):
            yield step, reader.run(step)


def check_outputs(outputs: Iterable[tuple[Step, str]], *, is_live: bool = False) -> None:
    """Check that steps have printed what their page shows."""
    for step, output in outputs:
        shown, printed = (normalised(text, is_live=is_live) for text in (step.shown, output))
        assert matches(shown, printed), f"{step.code}\n--- expected\n{shown}--- printed\n{printed}"


def _main(page: str, folder: str, *packages: str) -> None:
    with reading(Path(folder), dict(os.environ)) as reader:
        for step, output in outputs_of(steps_of(page), reader, packages):
            print(json.dumps([*step, output]), flush=True)


if __name__ == "__main__":  # run a page, and print each step with its output: python -m support.pages PAGE FOLDER
    _main(*sys.argv[1:])
