"""Conversions that a pool runs in place of the real one."""

from __future__ import annotations

import os
import signal

from msggen.exports.fleet import Batch, Task, convert_batch


def convert_or_die(task: Task) -> Batch:
    """Convert recordings; for one called `deadly`, kill the process, as the system does for want of memory."""
    if any("deadly" in path for path in task.paths):
        os.kill(os.getpid(), signal.SIGKILL)
    return convert_batch(task)
