"""The process of a pool: calls a function with each task that its parent sends, until that has ended.

It imports little, because a Ctrl-C before it is ignored would leave a trace.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from queue import SimpleQueue
from typing import Any


def main() -> None:
    """Read pairs of a function and a task from stdin, and write what each function returns to stdout, with pickle."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches both, and the parent decides
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(2, 1)  # what somebody prints is no outcome
        tasks: SimpleQueue[Any] = SimpleQueue()
        threading.Thread(target=_read, args=(tasks,), daemon=True).start()
        while True:
            function, task = tasks.get()
            pickle.dump(function(task), output)
            output.flush()


def _read(tasks: SimpleQueue[Any]) -> None:
    """Read tasks until the parent closes the pipe, and then end the process: nothing outlives the parent."""
    try:
        while True:
            tasks.put(pickle.load(sys.stdin.buffer))  # noqa: S301 - from the parent
    finally:
        os._exit(0)
