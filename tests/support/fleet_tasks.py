"""Conversions that a pool runs in place of the real one."""

from __future__ import annotations

import os
import signal

from msggen.recordings.fleet.single import Outcome, Task, convert_one


def convert_or_die(task: Task) -> Outcome:
    """Convert a recording; for one called `deadly`, kill the process, as the system does for want of memory."""
    if "deadly" in task.path:
        os.kill(os.getpid(), signal.SIGKILL)
    return convert_one(task)
