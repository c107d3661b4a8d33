"""Loops of commands that watch a vehicle until Ctrl-C, a time or a number of results; and which errors are Ctrl-C."""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from logging import getLogger
from math import inf
from typing import TYPE_CHECKING

from msggen.cli.options import add_shared, add_value
from msggen.cli.printing import discard_output
from msggen.cli.values import COUNT, positive

if TYPE_CHECKING:
    from msggen.vehicle.vehicle import Vehicle


def is_interrupt(error: BaseException) -> bool:
    """Whether an exception is Ctrl-C, or was raised while Ctrl-C ended something.

    KeyboardInterrupt in `threading.Condition.wait` becomes a RuntimeError if it comes before the lock is taken again.
    """
    found: BaseException | None = error
    while found is not None and not isinstance(found, KeyboardInterrupt):
        found = found.__context__
    return found is not None


def add_window(parser: argparse.ArgumentParser, verb: str = "report on", default: float = 3.0) -> None:
    """Add the option that names the time in s whose samples count, with what is done with them."""
    text = f"{verb} the samples of this time (default: {default:g})"
    add_value(parser, "--window", "SECONDS", positive, text, default=f"{default:g}")


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add the options that end a command: a number of results, or a time."""
    add_value(parser, "-n, --count", "N", COUNT, "end after N messages, or reports")
    add_shared(parser, "--for")


@contextmanager
def watching() -> Iterator[None]:
    """End the block at Ctrl-C, and when nobody reads the output any more."""
    gc.enable()  # unlike other commands, this one may run for days
    try:
        yield
    except (KeyboardInterrupt, RuntimeError) as error:
        if not is_interrupt(error):
            raise
    except BrokenPipeError:
        discard_output()


@contextmanager
def telling(level: int, *names: str) -> Iterator[None]:
    """Let loggers tell what has a level, and nothing below it, in the block."""
    loggers = {logger: logger.level for logger in map(getLogger, names)}
    try:
        for logger in loggers:
            logger.setLevel(level)
        yield
    finally:
        for logger, before in loggers.items():
            logger.setLevel(before)


def rounds(seconds: float | None, vehicle: Vehicle, period: float) -> Iterator[None]:
    """Yield every `period` seconds until the time is over: the last time at its end, at least `period` after the time
    before. Without a time, do not end.

    Flushes the output after each round, and says on stderr when the vehicle disconnects and connects again. Raises
    LinkError if the link has failed.
    """
    start, limit = time.monotonic(), seconds or inf
    number, was_connected = 0, True
    while True:
        number += 1
        due = start + number * period
        is_last = (number + 1) * period > limit
        rest = (start + limit if is_last else due) - time.monotonic()
        if rest > 0:
            time.sleep(rest)
        else:
            number = int((time.monotonic() - start) / period)  # the output was slow
        if vehicle.is_connected != was_connected:
            was_connected = not was_connected
            text = "the vehicle is connected again" if was_connected else "the vehicle has disconnected, waiting for it"
            print(text, file=sys.stderr, flush=True)
        if not was_connected:
            check_link(vehicle)
        yield
        print(end="", flush=True)
        if is_last:
            return


def check_link(vehicle: Vehicle) -> None:
    """Raise LinkError if the link has failed: a vehicle that is disconnected would be waited for without an end."""
    from msggen.link.link import LinkTimeoutError, NotConnectedError

    with suppress(LinkTimeoutError, NotConnectedError):
        vehicle.wait_connected(0)
