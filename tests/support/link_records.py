"""A listener that keeps what a link tells it, and waits for it; and what a link may leave behind."""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from msggen.generate import cache
from msggen.link.link import Listener, Remote, Route, Sample, Service

PATIENCE = 20.0
"""The longest time in s that a test waits for anything."""


class Records(Listener):
    """A listener that keeps everything."""

    def __init__(self) -> None:
        self.remotes: list[Remote] = []
        self.opened_routes: list[tuple[Remote, Route | Service]] = []
        self.gone: list[tuple[Remote, str]] = []
        self.samples: list[Sample] = []
        self.replies: list[tuple[Remote, Service, int, bytes]] = []
        self.refusals: list[tuple[Remote, int, str]] = []
        self.losses: list[tuple[Remote, int]] = []
        self.definitions: list[tuple[Remote, dict[str, int], bool]] = []
        self.warnings: list[str] = []
        self.failures: list[str] = []
        self.threads: set[int] = set()
        self._changed = threading.Condition()

    def wait(self, true: Callable[[], object], patience: float = PATIENCE) -> None:
        """Wait until something is true. Fails if it never is."""
        end = time.monotonic() + patience
        with self._changed:
            while not true():
                assert time.monotonic() < end, self
                self._changed.wait(0.05)

    def route(self, name: str) -> Route | Service:
        """Wait for a route or a service, and return the newest one with that name."""
        self.wait(lambda: any(route.name == name for _, route in self.opened_routes))
        return next(route for _, route in reversed(self.opened_routes) if route.name == name)

    def __repr__(self) -> str:
        return (
            f"remotes {self.remotes}, gone {self.gone}, {len(self.opened_routes)} routes, {len(self.samples)} samples, "
            f"replies {self.replies}, lost {self.losses}, warned {self.warnings}"
        )

    @contextmanager
    def _change(self) -> Iterator[None]:
        self.threads.add(threading.get_ident())
        with self._changed:
            yield
            self._changed.notify_all()

    def connected(self, remote: Remote) -> None:
        with self._change():
            self.remotes.append(remote)

    def opened(self, remote: Remote, route: Route | Service) -> None:
        with self._change():
            self.opened_routes.append((remote, route))

    def disconnected(self, remote: Remote, reason: str) -> None:
        with self._change():
            self.gone.append((remote, reason))

    def sample(self, remote: Remote, route: Route, payload: bytes, time: int) -> None:
        with self._change():
            self.samples.append(Sample(remote, route, payload, time))

    def replied(self, remote: Remote, service: Service, number: int, payload: bytes) -> None:
        with self._change():
            self.replies.append((remote, service, number, payload))

    def refused(self, remote: Remote, number: int, problem: str) -> None:
        with self._change():
            self.refusals.append((remote, number, problem))

    def lost(self, remote: Remote, missing: int) -> None:
        with self._change():
            self.losses.append((remote, missing))

    def identified(self, remote: Remote, hashes: Mapping[str, int], is_complete: bool) -> None:  # noqa: FBT001
        with self._change():
            self.definitions.append((remote, dict(hashes), is_complete))

    def warned(self, text: str) -> None:
        with self._change():
            self.warnings.append(text)

    def failed(self, reason: str) -> None:
        with self._change():
            self.failures.append(reason)


def held() -> tuple[set[int | None], int]:
    """Return the threads and the number of open files of this process, without the locks of packages, which stay."""
    gc.collect()
    folder = "/proc/self/fd"
    files = len(os.listdir(folder)) - len(cache._TAKEN) if sys.platform == "linux" else 0
    return {thread.ident for thread in threading.enumerate()}, files


@contextmanager
def nothing_is_left() -> Iterator[None]:
    """Check that the block leaves no thread and no open file behind."""
    before = held()
    gc.freeze()  # the collections after the block need not look at what lived before it
    yield
    for _ in range(100):
        if _left(before) == (set(), 0):
            break
        time.sleep(0.02)  # the kernel removes a thread shortly after it was joined
    assert _left(before) == (set(), 0)


def _left(before: tuple[set[int | None], int]) -> tuple[set[int | None], int]:
    """Return the threads and the number of files that are there now and were not before."""
    threads, files = held()
    return threads - before[0], max(0, files - before[1])  # what an earlier test has left can end meanwhile
