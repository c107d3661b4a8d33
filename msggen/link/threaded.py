"""What links have in common: a thread that receives and calls the listener, and releases all at its end."""

from __future__ import annotations

import threading
from abc import abstractmethod
from contextlib import ExitStack

from msggen.link.guard import guarded
from msggen.link.link import Link, LinkError, Listener


class ThreadedLink(Link):
    """A link with a thread."""

    def __init__(self) -> None:
        self._closing = False
        self._thread: threading.Thread | None = None

    @abstractmethod
    def open(self, listener: Listener) -> None:
        """Open what the link needs, which `release` releases if this fails. Raises LinkError."""

    @abstractmethod
    def serve(self, listener: Listener) -> None:
        """Receive until `_closing` is true. Raises LinkError if nothing can be received any more."""

    @abstractmethod
    def wake(self) -> None:
        """Let the thread look around, which ends. From any thread."""

    @abstractmethod
    def leave(self, reason: str, listener: Listener) -> None:
        """Report all vehicles as disconnected."""

    @abstractmethod
    def release(self) -> None:
        """Release what was opened."""

    def start(self, listener: Listener) -> None:
        """Open the link and start its thread. Raises LinkError."""
        if self._thread is not None or self._closing:
            raise LinkError("a link can be started once: make another one")
        guard, kind = guarded(listener), type(self).__name__.removesuffix("Link").lower()
        thread = threading.Thread(target=self._run, args=(guard,), name=f"msggen-{kind}", daemon=True)
        try:
            self.open(guard)
            self._thread = thread
            thread.start()
        except BaseException:
            self._thread = None  # it may be started again, unless a callback has closed it
            self.release()
            raise

    def close(self) -> None:
        """End the thread, and release everything. A callback may call it: then the thread ends after the callback."""
        self._closing = True
        thread = self._thread
        if thread is not None and thread.is_alive():
            self.wake()
            if thread is not threading.current_thread():
                thread.join()

    def _run(self, listener: Listener) -> None:
        failure = ""
        try:
            self.serve(listener)
        except LinkError as error:
            failure = str(error)
        except BaseException as error:  # noqa: BLE001 - told to the user, who would wait forever
            failure = f"the link failed: {type(error).__name__}: {error}"
        self._closing = True
        with ExitStack() as ending:  # from the last to the first, also if one of them raises an exception
            if failure:
                ending.callback(listener.failed, failure)
            ending.callback(self.release)
            ending.callback(self.leave, failure or "the link was closed", listener)
