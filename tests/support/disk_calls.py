"""Calls that change the disk, each of which a test can make fail, or kill the process at.

The calls are those of the modules `os` and `io`, so code that opens, writes, renames or removes files is covered,
whatever it does, and so is `shutil`. The swap of folders, which has no function in `os`, is a call of msggen's own.
"""

from __future__ import annotations

import builtins
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from typing import TYPE_CHECKING, Any

from msggen.base.disk import swap

CHANGING = (
    *("chmod", "fchmod", "fsync", "fdatasync", "ftruncate", "link", "mkdir", "remove", "rename", "replace", "rmdir"),
    *("symlink", "truncate", "unlink", "utime", "write", "copy_file_range", "sendfile"),
)
"""Functions of `os` that change the disk. `os.open` and `open` count if they open a file for writing."""

if TYPE_CHECKING:
    from typing_extensions import Self

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC

_KILLED = 9

Hook = Callable[[str], None]
"""A function that is called before each call, with its name; it may raise OSError or end the process."""


class _Written:
    """A file open for writing, whose `write` is a call too. Half of the data is written before the hook is called."""

    def __init__(self, stream: Any, hook: Hook) -> None:
        self._stream, self._hook = stream, hook

    def write(self, data: Any) -> Any:
        half = len(data) // 2
        self._stream.write(data[:half])
        with suppress(OSError):
            self._stream.flush()
        self._hook("write")
        written = self._stream.write(data[half:])
        return half + written if isinstance(written, int) else written

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def __enter__(self) -> Self:
        self._stream.__enter__()
        return self

    def __exit__(self, *error: object) -> Any:
        return self._stream.__exit__(*error)

    def __iter__(self) -> Any:
        return iter(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _counting(call: Any, name: str, hook: Hook) -> Any:
    """Return a function that calls `hook` before `call`."""

    def counting(*arguments: Any, **more: Any) -> Any:
        hook(name)
        return call(*arguments, **more)

    return counting


def _opening(call: Any, name: str, hook: Hook) -> Any:
    """Return a function like os.open that calls `hook` before it opens a file for writing."""

    def opening(path: Any, flags: int, *arguments: Any, **more: Any) -> Any:
        if flags & _WRITING:
            hook(name)
        return call(path, flags, *arguments, **more)

    return opening


def _opening_stream(call: Any, name: str, hook: Hook) -> Any:
    """Return a function like `open` that calls `hook` before it opens a file for writing, and before each write."""

    def opening(path: Any, mode: str = "r", *arguments: Any, **more: Any) -> Any:
        if not set(mode) & set("wax+") or str(path).startswith("/dev/"):
            return call(path, mode, *arguments, **more)
        hook(name)
        return _Written(call(path, mode, *arguments, **more), hook)

    return opening


_WRAPPED = (
    *((os, name, _counting) for name in CHANGING),
    (os, "open", _opening),
    *((owner, name, _opening_stream) for owner, name in ((io, "open"), (builtins, "open"), (os, "fdopen"))),
    (swap, "_exchange", _counting),
)


@contextmanager
def hooked(hook: Hook) -> Iterator[None]:
    """Call `hook` before each call that changes the disk."""
    wrapped = [(owner, name, getattr(owner, name), wrap) for owner, name, wrap in _WRAPPED if hasattr(owner, name)]
    for owner, name, call, wrap in wrapped:
        setattr(owner, name, wrap(call, name, hook))
    try:
        yield
    finally:
        for owner, name, call, _ in wrapped:
            setattr(owner, name, call)


def dies_at(number: int, run: Callable[[], object]) -> bool:
    """Run a function in a process that ends before its call number `number`, from 0, that changes the disk.

    Nothing is cleaned up and no buffer is written then, as after SIGKILL. Return False if there are fewer calls.
    """
    child = os.fork()
    if child == 0:
        calls = count()

        def hook(_: str) -> None:
            if next(calls) == number:
                os._exit(_KILLED)

        try:
            with hooked(hook):
                run()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == _KILLED
