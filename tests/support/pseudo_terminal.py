"""A program in a terminal: a pseudo terminal, with pyte as the terminal's screen."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Mapping
from typing import Any

from support.lazy import Lazy

pyte = Lazy("pyte")

LONGEST = 60.0
"""Seconds after which a test gives up."""


class TerminalProgram:
    """A Python program that believes to be in a terminal of some size."""

    def __init__(
        self, *arguments: str, size: tuple[int, int] = (100, 40), variables: Mapping[str, str] | None = None
    ) -> None:
        self._master, self._slave = pty.openpty()
        self.screen = pyte.Screen(*size)
        self._stream = pyte.ByteStream(self.screen)
        self.written = b""
        """All that the program has written."""
        self._set_size(size)
        self.modes = termios.tcgetattr(self._slave)
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=self._slave,
            stdout=self._slave,
            stderr=self._slave,
            start_new_session=True,
            env={**os.environ, "TERM": "xterm-256color", **(variables or {})},
        )

    def _set_size(self, size: tuple[int, int]) -> None:
        fcntl.ioctl(self._slave, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))

    def resize(self, columns: int, lines: int) -> None:
        """Give the terminal another size, and tell the program."""
        self._set_size((columns, lines))
        self.screen.resize(lines, columns)
        self.process.send_signal(signal.SIGWINCH)

    def press(self, keys: str) -> None:
        """Type."""
        os.write(self._master, keys.encode())

    @property
    def lines(self) -> list[str]:
        """The lines of the screen."""
        return [line.rstrip() for line in self.screen.display]

    @property
    def text(self) -> str:
        """The screen."""
        return "\n".join(self.lines)

    def wait_for(self, condition: Callable[[str], Any]) -> str:
        """Read until the screen satisfies a condition, and return it."""
        end = time.monotonic() + LONGEST
        while not condition(self.text):
            assert time.monotonic() < end, f"not in time; the screen is\n{self.text}"
            self._read(0.2)
        return self.text

    def _read(self, timeout: float) -> None:
        if select.select([self._master], [], [], timeout)[0]:
            data = os.read(self._master, 65536)
            self.written += data
            self._stream.feed(data)

    def wait(self) -> int:
        """Read until the program ends, and return its exit code."""
        end = time.monotonic() + LONGEST
        while self.process.poll() is None:
            assert time.monotonic() < end, f"does not end; the screen is\n{self.text}"
            self._read(0.05)
        self._read(0.0)
        return self.process.returncode

    @property
    def is_restored(self) -> bool:
        """Whether the modes of the terminal are those from before the program."""
        return termios.tcgetattr(self._slave) == self.modes

    def close(self) -> None:
        """End the program if it runs, and the terminal."""
        self.process.kill()
        self.process.wait()
        os.close(self._master)
        os.close(self._slave)
