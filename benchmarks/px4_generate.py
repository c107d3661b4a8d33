"""Compares `msggen px4-generate` with a firmware's scripts: `python benchmarks/px4_generate.py PX4_TREE`.

The scripts run in the same environment: `pip install pyros-genmsg 'empy<4' pyyaml`.
"""

from __future__ import annotations

import os
import sys
import tempfile
import timeit
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from msggen.base.disk.staging import write_if_changed
from msggen.generate.px4.definitions import Definitions
from msggen.generate.px4.messages import Kind, Request, generate_messages
from msggen.generate.text.empy import EmpyTemplate
from rounds import race_processes

ROUNDS = 7
MSGGEN = (sys.executable, "-m", "msggen", "px4-generate")
FOUR = {
    "--headers": Kind.HEADERS,
    "--sources": Kind.SOURCES,
    "--json": Kind.JSON,
    "--uorb-idl-header": Kind.IDL_HEADERS,
}
IMPORTS = (
    "import msggen.cli, msggen.cli.commands.px4_generate, msggen.generate.px4.messages, "
    "msggen.generate.text.empy_program"
)


class Task(NamedTuple):
    """A call of a script in the firmware's build, for one of the four kinds of message files, or for another file."""

    name: str
    script: str
    arguments: tuple[str, ...]
    request: Request | None = None


class Tree:
    """A PX4-Autopilot tree."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.templates = path / "Tools/msg/templates"
        self.includes = [str(folder) for folder in (path / "msg", path / "msg/versioned") if folder.is_dir()]
        self.files = [str(file) for folder in self.includes for file in sorted(Path(folder).glob("*.msg"))]

    def tasks(self) -> Iterator[Task]:
        """Yield the requests of this firmware's build. Older firmware has fewer."""
        script = str(self.path / "Tools/msg/px_generate_uorb_topic_files.py")
        messages = ("-f", *self.files, "-i", *self.includes, "-e")
        for option, kind in FOUR.items():
            folder = self.templates / ("cdrstream" if kind is Kind.IDL_HEADERS else "uorb")
            if (folder / kind.value[0]).is_file():
                request = Request(kind, tuple(self.files), tuple(self.includes), str(folder), "px4")
                yield Task(option.strip("-"), script, (option, *messages, str(folder), "-o"), request)
        yield Task("headers, ucdr", script, ("--headers", *messages, str(self.templates / "ucdr"), "-o"))
        client = self.path / "src/modules/uxrce_dds_client"
        bridge = ("-y", str(client / "dds_topics.yaml"), "-t", str(client / "dds_topics.h.em"), "-u")
        yield Task("dds_topics.h", str(client / "generate_dds_topics.py"), bridge)
        zenoh = self.path / "src/modules/zenoh"
        if (zenoh / "dds_topics.yaml").is_file():
            topics = ("-y", str(zenoh / "dds_topics.yaml"), "-t", str(zenoh / "default_topics.c.em"), "-u")
            yield Task("default_topics.c, Zenoh", str(client / "generate_dds_topics.py"), topics)


def main() -> None:
    """Measure and print."""
    if len(sys.argv) != len(("script", "tree")):
        sys.exit(__doc__)
    os.environ["PYTHONHASHSEED"] = "0"  # one of the firmware's files depends on the order of a set
    tree = Tree(Path(sys.argv[1]).resolve())
    tasks = list(tree.tasks())
    print(f"{len(tree.files)} messages; least of {ROUNDS} runs of each process, in seconds\n")
    with tempfile.TemporaryDirectory() as folder:
        print_times(tasks, Path(folder))
        print_stages(tree, [task.request for task in tasks if task.request], Path(folder))


def print_times(tasks: list[Task], folder: Path) -> None:
    """Print the times of the scripts and of msggen. Every run writes into a new folder."""
    commands = {}
    for number, task in enumerate(tasks):
        commands[f"{task.name} by script"] = [
            sys.executable,
            task.script,
            *task.arguments,
            f"{folder}/script{number}_ROUND",
        ]
        commands[f"{task.name} by msggen"] = [*MSGGEN, *task.arguments, f"{folder}/msggen{number}_ROUND"]
    least = race_processes(commands, ROUNDS)
    rows = {task.name: (least[f"{task.name} by script"], least[f"{task.name} by msggen"]) for task in tasks}
    four = [rows[task.name] for task in tasks if task.request]
    print(f"{'':24} {'scripts':>8} {'msggen':>8} {'times':>6}  bytes")
    for number, task in enumerate(tasks):
        same = contents(folder / f"script{number}_0") == contents(folder / f"msggen{number}_0")
        print_row(task.name, *rows[task.name], "same" if same else "differ")
    print_row(f"{len(four)} kinds together", sum(row[0] for row in four), sum(row[1] for row in four))
    print_row("all", sum(row[0] for row in rows.values()), sum(row[1] for row in rows.values()))


def contents(folder: Path) -> Mapping[str, bytes]:
    """Return the files of a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def print_row(name: str, script: float, ours: float, same: str = "") -> None:
    """Print one line of the table."""
    print(f"{name:24} {script:8.2f} {ours:8.2f} {script / ours:6.1f}  {same}".rstrip())


def print_stages(tree: Tree, requests: list[Request], folder: Path) -> None:
    """Print how msggen's time for the four kinds is divided."""
    bare, imports = "python", "imports"
    processes = race_processes({bare: [sys.executable, "-c", ""], imports: [sys.executable, "-c", IMPORTS]}, ROUNDS)
    stages = dict.fromkeys(("definitions", "templates", "expansion", "writing"), 0.0)
    for request in requests:
        for name, took in measure_stages(request, tree, folder).items():
            stages[name] += took
    starts = {"starts of Python": processes[bare], "imports": processes[imports] - processes[bare]}
    print(f"\nmsggen's time by step, {len(requests)} kinds together")
    for name, took in {**{name: took * len(requests) for name, took in starts.items()}, **stages}.items():
        print(f"{name:24} {took:8.2f}")


def measure_stages(request: Request, tree: Tree, folder: Path) -> Mapping[str, float]:
    """Return the seconds of each step of a process after its imports."""
    path = os.path.join(request.templates, request.kind.value[0])
    made = generate_messages(request)
    search_path = {request.package: tree.includes}
    definitions = least(lambda: Definitions().read_all(request.files, request.package, search_path))
    template = least(lambda: EmpyTemplate(path))
    whole = least(lambda: generate_messages(request))
    writing = least(lambda: write_all(made, Path(tempfile.mkdtemp(dir=folder))))
    return {
        "definitions": definitions,
        "templates": template,
        "expansion": whole - definitions - template,
        "writing": writing,
    }


def least(work: Callable[[], object]) -> float:
    """Return the shortest time of `work` in seconds."""
    return min(timeit.repeat(work, number=1, repeat=ROUNDS))


def write_all(files: Mapping[str, str], folder: Path) -> None:
    """Write files as the command does."""
    for name, text in files.items():
        write_if_changed(str(folder / name), text)


if __name__ == "__main__":
    main()
