"""The state of a command that runs for a while, in a line of the terminal below what it has printed."""

from __future__ import annotations

import sys
from collections.abc import Callable

from msggen.base.foreign import Styled
from msggen.cli.printing import is_terminal, terminal_width


class Status:
    """Lines that stay, and in a terminal a line below them with the state, which the next call replaces."""

    def __init__(self, *, is_quiet: bool) -> None:
        self._is_quiet = is_quiet
        self._has_state = is_terminal(sys.stdout)

    def show(self, *lines: str, state: Callable[[], str] = str) -> None:
        """Print `lines` and the new state, by default none, unless it is quiet. Programs can read them at once."""
        if self._is_quiet:
            return
        if self._has_state:
            print(Styled("\r\033[K"), end="")
        for line in lines:
            print(line)
        if self._has_state:
            print(state()[: terminal_width(80) - 1], end="")
        print(end="", flush=True)
