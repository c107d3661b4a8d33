"""The screen and the keys of a terminal, for programs that draw again and again."""

from __future__ import annotations

import os
import re
import select
import signal
import sys
import termios
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from msggen.base.foreign import Styled

if TYPE_CHECKING:
    from typing_extensions import Self

_ENTER = "\033[?1049h\033[?25l\033[H\033[2J"  # the second screen, without a cursor
_LEAVE = "\033[?25h\033[?1049l"

_KEYS = {
    "\033": "escape",
    "\r": "enter",
    "\n": "enter",
    "\t": "tab",
    " ": "space",
    "\b": "backspace",
    "\x7f": "backspace",
    "\x03": "ctrl-c",
    "\x04": "ctrl-c",
}
_SEQUENCES = {
    "A": "up",
    "B": "down",
    "C": "right",
    "D": "left",
    "H": "home",
    "F": "end",
    "1~": "home",
    "7~": "home",
    "4~": "end",
    "8~": "end",
    "5~": "page up",
    "6~": "page down",
    "3~": "delete",
}
"""Keys that a terminal sends as a sequence: ESC, `[` or `O`, and these characters."""

_SEQUENCE = re.compile(r"\033[\[O]([0-9;]*[A-Za-z~])|(.)", re.DOTALL)
_REST = 0.03
"""How long in s to wait for the rest of a sequence after an ESC."""


class Terminal:
    """The terminal of this process, as a context manager: the screen and the modes are restored at the end.

    Ctrl-C is a key, `ctrl-c`, so that the end is always an orderly one. A second screen is used, so that what was
    there before comes back.
    """

    def __enter__(self) -> Self:
        self._input = sys.stdin.fileno()
        self._modes = termios.tcgetattr(self._input) if os.isatty(self._input) else None
        self._signals = {number: signal.signal(number, self._end) for number in (signal.SIGTERM, signal.SIGHUP)}
        self._signals[signal.SIGWINCH] = signal.signal(signal.SIGWINCH, lambda *_: None)
        self._woken, self._waker = os.pipe()
        for end in (self._woken, self._waker):
            os.set_blocking(end, False)
        self._signal_fd = signal.set_wakeup_fd(self._waker, warn_on_full_buffer=False)
        self._lines: list[str] = []
        self._size = (0, 0)
        if self._modes is not None:
            modes: list[Any] = termios.tcgetattr(self._input)
            modes[3] &= ~(termios.ICANON | termios.ECHO | termios.ISIG)
            termios.tcsetattr(self._input, termios.TCSAFLUSH, modes)
        self._write(_ENTER)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._write(_LEAVE)
        finally:
            if self._modes is not None:
                termios.tcsetattr(self._input, termios.TCSAFLUSH, self._modes)
            signal.set_wakeup_fd(self._signal_fd)
            for number, handler in self._signals.items():
                signal.signal(number, handler)
            os.close(self._woken)
            os.close(self._waker)

    @staticmethod
    def _end(number: int, _: object) -> None:
        raise SystemExit(128 + number)  # as a shell reports it

    @property
    def size(self) -> tuple[int, int]:
        """The columns and lines."""
        columns, lines = os.get_terminal_size(sys.stdout.fileno())
        return columns or 80, lines or 24  # a terminal that nobody has told its size has none

    def keys(self, timeout: float) -> list[str]:
        """Return the keys that were pressed. Waits for one, or for a resize, for up to `timeout` s."""
        inputs = [self._woken] if self._modes is None else [self._woken, self._input]
        ready, _, _ = select.select(inputs, [], [], timeout)
        if self._woken in ready:
            os.read(self._woken, 4096)
        if self._input not in ready:
            return []
        data = os.read(self._input, 4096)
        if not data:
            return ["ctrl-c"]  # the terminal is gone
        if data.endswith(b"\033") and select.select([self._input], [], [], _REST)[0]:
            data += os.read(self._input, 4096)
        return [*keys_in(data.decode(errors="replace"))]

    def draw(self, lines: Sequence[str]) -> None:
        """Show lines that are no wider than the screen. Only those that differ from the last ones are sent."""
        if self.size != self._size:
            self._size, self._lines = self.size, []
            self._write("\033[2J")
        changed = [
            f"\033[{number};1H\033[K{line}\033[0m"  # K after a full line would erase its last character
            for number, line in enumerate(lines, 1)
            if self._lines[number - 1 : number] != [line]
        ]
        self._lines = [*lines]
        self._write("".join(changed))

    def _write(self, text: str) -> None:
        print(Styled(text), end="", flush=True)


def keys_in(text: str) -> Iterator[str]:
    """Yield the names of the keys in what a terminal sends: `up`, `enter`, `a`. Unknown sequences are left out."""
    for sequence, character in _SEQUENCE.findall(text):
        name = _SEQUENCES.get(sequence, "") if sequence else _KEYS.get(character, character)
        if name and (len(name) > 1 or name.isprintable()):
            yield name
