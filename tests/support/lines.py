"""A serial line made of pseudo terminals."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def joined() -> Iterator[tuple[str, str]]:
    """Join two pseudo terminals, as two ends of a line, and return their paths."""
    masters, slaves = zip(os.openpty(), os.openpty(), strict=True)
    for master in masters:
        os.set_blocking(master, True)
    ended = False

    def carry(source: int, target: int) -> None:
        with suppress(OSError):
            while not ended:
                os.write(target, os.read(source, 4096))

    threads = [threading.Thread(target=carry, args=pair, daemon=True) for pair in (masters, masters[::-1])]
    for thread in threads:
        thread.start()
    try:
        yield os.ttyname(slaves[0]), os.ttyname(slaves[1])
    finally:
        ended = True
        for slave in slaves:  # ends the reads of the threads, with a byte or with an error
            with suppress(OSError):
                os.write(slave, b"\0")
        for thread in threads:
            thread.join()
        for file in (*masters, *slaves):
            os.close(file)
