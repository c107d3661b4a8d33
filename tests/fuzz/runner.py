"""The runner of campaigns: a case fails if its check raises an error or exceeds the limits of time and memory."""

from __future__ import annotations

import importlib
import itertools
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from pprint import pformat
from random import Random
from types import FrameType
from typing import Any, Protocol, cast

NAMES = (
    "payloads",
    "values",
    "definitions",
    "modules",
    "readers",
    "archives",
    "kills",
    "faults",
    "strangers",
    "arguments",
    "datagrams",
    "recordings",
    "conversions",
    "fleets",
    "stores",
    "servers",
    "structures",
    "shadows",
    "settings",
    "sessions",
    "events",
    "flights",
    "measurements",
    "records",
    "stalls",
    "owners",
    "mcp",
    "editors",
    "missions",
    "zenoh",
    "networks",
    "motions",
    "findings",
)
"""The campaigns, each a module of this package."""

SEED = 1

CPU_SECONDS, SECONDS = 10, 30
"""The most time that a case takes. A case of at most some 100 kB that exceeds it is not handled in linear time."""

MEMORY = 2**29
"""The most bytes by which the address space may grow in a case."""


class Campaign(Protocol):
    """A module with a campaign."""

    COUNT: int

    def case(self, chance: Random) -> Any:
        """Return a case, which follows from `chance` alone."""

    def check(self, case: Any) -> None:
        """Raise an error if the outcome of the case is wrong."""


@dataclass(frozen=True)
class Failure:
    """A case whose outcome is wrong, with the traceback as text."""

    campaign: str
    seed: int
    index: int
    case: object
    trace: str

    @property
    def command(self) -> str:
        """The command that repeats the case."""
        return f"python -m tests.fuzz {self.campaign} --seed {self.seed} --index {self.index}"

    def save(self, folder: Path) -> Path:
        """Write the case and the traceback to a file in `folder`, and return its path."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.campaign}-{self.seed}-{self.index}.txt"
        text = f"{self.command}\n\n{pformat(self.case, width=120)}\n\n{self.trace}"
        path.write_text(text, encoding="utf-8", errors="backslashreplace")
        return path


class TooSlowError(BaseException):
    """Raised in a case that takes too long; not an Exception, so that nothing catches it."""


def find(name: str) -> Campaign:
    """Return the campaign of that name."""
    return cast("Campaign", importlib.import_module(f"fuzz.{name}"))


def run(name: str, seed: int, indices: Iterable[int], seconds: float | None = None) -> tuple[int, Failure | None]:
    """Check the cases with these indices until one fails or the time is over. Return their number and the failure."""
    campaign = find(name)
    end = time.monotonic() + seconds if seconds else None
    count = 0
    for index in indices:
        failure = run_one(campaign, name, seed, index)
        count += 1
        if failure:
            return count, failure
        if end and time.monotonic() >= end:
            break
    return count, None


def run_one(campaign: Campaign, name: str, seed: int, index: int) -> Failure | None:
    """Check one case, and return the failure if there is one."""
    case = None
    try:
        case = campaign.case(Random(f"{name} {seed} {index}"))  # noqa: S311 - not used for security
        with limited(getattr(campaign, "MEMORY", MEMORY)):
            campaign.check(case)
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: BLE001 - SystemExit and TooSlowError too
        return Failure(name, seed, index, case, traceback.format_exc())
    return None


def indices_of(process: int, processes: int, count: int | None) -> Iterator[int]:
    """Yield the indices of the cases that one of several processes checks."""
    return itertools.islice(itertools.count(process, processes), count and len(range(process, count, processes)))


def _count_memory_of_arrow() -> None:
    """Let Arrow take memory of the system: its own pool reserves 1 GiB of addresses, which is no use of memory."""
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"
    arrow: Any = sys.modules.get("pyarrow")
    if arrow is not None:
        arrow.set_memory_pool(arrow.system_memory_pool())


@contextmanager
def limited(memory: int = MEMORY) -> Iterator[None]:
    """Limit the time and the memory of a case."""

    def stop(number: int, _: FrameType | None) -> None:
        raise TooSlowError(f"more than {CPU_SECONDS if number == signal.SIGPROF else SECONDS} s")

    _count_memory_of_arrow()
    handlers = {number: signal.signal(number, stop) for number in (signal.SIGPROF, signal.SIGALRM)}
    before = resource.getrlimit(resource.RLIMIT_AS)
    signal.setitimer(signal.ITIMER_PROF, CPU_SECONDS)
    outer = signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        if sys.platform == "linux":
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
            resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + memory, before[1]))
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.setitimer(signal.ITIMER_REAL, *outer)  # the limit of the test, of pytest-timeout
