"""The time of msggen's commands as processes, and of builds of ten and a hundred times as many messages."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from effort import Effort
from environment import ROOT
from msggen.definitions.model import Catalog
from rounds import race_processes

MSGGEN = (sys.executable, "-m", "msggen")
COLD, AGAIN = "build, all of v1.18", "build, nothing changed"


class Scale(NamedTuple):
    """Seconds of a build of this many messages, and of the next build."""

    messages: int
    cold: float
    again: float


def measure_commands(folder: Path, effort: Effort) -> Mapping[str, float]:
    """Return the seconds of each of msggen's commands on all of v1.18."""
    package = str(folder / "px4_msgs")
    build = [*MSGGEN, "build", "--quiet", "--output"]
    sync = [*MSGGEN, "sync", "--quiet", "--px4", str(ROOT), "--create"]
    commands = {
        "bare interpreter": [sys.executable, "-c", "pass"],
        COLD: [*build, str(folder / "build_ROUND")],
        AGAIN: [*build, str(folder / "build_again")],
        "sync, a whole new package": [*sync, f"{package}_ROUND"],
        "sync, nothing changed": [*sync, package],
        "check, a package against its firmware": [*MSGGEN, "check", "--px4", str(ROOT), package],
    }
    return race_processes(commands, effort.processes)


def measure_scale(folder: Path, catalog: Catalog, effort: Effort) -> list[Scale]:
    """Return the times of builds of more and more copies of the whole set, in fewer rounds for larger builds."""
    found = []
    for copies in effort.copies:
        source = folder / f"{copies}_times"
        count = write_copies(source, catalog, copies)
        build = [*MSGGEN, "build", "--quiet", "--msg-dir", str(source), "--output"]
        cold, again = f"{folder}/cold_ROUND", f"{folder}/again"
        least = race_processes({COLD: [*build, cold], AGAIN: [*build, again]}, effort.processes // copies + 1)
        found.append(Scale(count, least[COLD], least[AGAIN]))
        for left in (*folder.glob("cold_*"), folder / "again", source):
            shutil.rmtree(left)
    return found


def write_copies(folder: Path, catalog: Catalog, copies: int) -> int:
    """Write copies of the embedded set into `folder`, with unique names and topics. Return the number of messages."""
    names = {message.name for message in catalog.messages.values() if message.folder == "msg"}
    folder.mkdir(parents=True)
    for path in sorted(path for part in ("msg", "msg/versioned") for path in (ROOT / part).glob("*.msg")):
        text = path.read_text(encoding="utf-8")
        for number in range(copies):
            name = f"{path.stem}Copy{number}"
            (folder / f"{name}.msg").write_text(renamed(text, names, number), encoding="utf-8")
    return len(names) * copies


def renamed(text: str, names: set[str], number: int) -> str:
    """Return a definition that nests the copies with this number, and declares unique topics."""

    def copied(found: re.Match[str]) -> str:
        return f"{found[0]}Copy{number}" if found[0] in names else found[0]

    lines = []
    for line in text.splitlines(keepends=True):
        if line.startswith("# TOPICS "):
            topics = line.split()[2:]
            lines.append(f"# TOPICS {' '.join(f'{topic}_copy{number}' for topic in topics)}\n")
        else:
            lines.append(re.sub(r"^\w+", copied, line))
    return "".join(lines)
