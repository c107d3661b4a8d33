"""Ends the processes that a test has started and left running, on Linux."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, resource_tracker

_SET_CHILD_SUBREAPER = 36
"""The number of this request to prctl, from <linux/prctl.h>."""


def adopt_orphans() -> None:
    """Become the parent of the processes whose parent, a descendant of this process, ends before them."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1)


def children() -> set[int]:
    """Return the ids of the child processes, without those that multiprocessing keeps; none if this is not Linux."""
    if sys.platform != "linux" or not _has_children():
        return set()
    found = {int(pid) for pid in os.listdir("/proc") if pid.isdigit() and _parent(pid) == os.getpid()}
    kept = (vars(resource_tracker._resource_tracker), vars(forkserver._forkserver))
    return found - {kept[0]["_pid"], kept[1]["_forkserver_pid"]}


def _has_children() -> bool:
    """Ask the system, because a look through all processes takes long."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def _parent(pid: str) -> int | None:
    """Return the parent of a process, or None if it has ended."""
    with suppress(OSError), open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as stream:
        return int(stream.read().rpartition(")")[2].split()[1])
    return None


@contextmanager
def ended() -> Iterator[None]:
    """Kill the processes that are started in the meantime and still run at the end, and their descendants."""
    before = children()
    yield
    while left := children() - before:
        for pid in left:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
