"""`msggen sim --log`: the ULog of a simulated vehicle."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any

from msggen.base.diagnostics import InputError, input_error
from msggen.base.exit_codes import DONE
from msggen.base.recording_formats import FORMATS
from msggen.cli.options import check_parent
from msggen.cli.packages import topics_of
from msggen.cli.printing import number_of_bytes

if TYPE_CHECKING:
    from msggen.sim import Options
    from msggen.sim.ulog import UlogWriter

_LONGEST = 600.0
"""The time in s after which a flight ends if it has not landed."""


def check_ulog(path: str) -> None:
    """Raise an InputError if a ULog cannot be created because of its name."""
    suffix = FORMATS["ulog"].suffix
    if not path.lower().endswith(suffix):
        raise input_error(path, "R101", f"a ULog is written: choose a name that ends in {suffix}", 0)
    if os.path.lexists(path):
        raise _taken(path)
    check_parent(path)


def endpoint_topics(package: ModuleType) -> Mapping[str, Any]:
    """Return the classes of the messages of all endpoints, by the names of their topics in uORB."""
    return {each.uorb_topic: each.message for each in topics_of(package).ENDPOINTS}


@contextmanager
def new_log(options: argparse.Namespace, topics: Mapping[str, Any], label: str) -> Iterator[UlogWriter]:
    """Create the file, and close it at the end. Raises an InputError, also if it cannot be written further."""
    from msggen.sim.alone import BOOT
    from msggen.sim.parameters import PARAMETERS
    from msggen.sim.ulog import UlogError, UlogWriter, Vehicle

    path = options.log
    try:
        log = UlogWriter(path, BOOT, topics, {**PARAMETERS, **dict(options.param)}, Vehicle(options.key, label))
    except FileExistsError:
        raise _taken(path) from None
    except (OSError, UlogError) as error:
        raise _unwritable(path, error) from None
    try:
        with log:
            yield log
    except UlogError as error:
        raise _unwritable(path, error) from None


def fly_alone(options: argparse.Namespace, package: ModuleType, label: str, vehicle: Options) -> int:
    """Let a vehicle fly by itself, and write what it flew."""
    from msggen.sim.alone import BOOT, LoneFlight

    flight = LoneFlight(package, vehicle, time.time_ns() // 1000)
    seconds = getattr(options, "for") or _LONGEST  # a keyword
    with new_log(options, flight.topics, label) as log:
        flight.run(log, BOOT + round(seconds * 1e6))
    if not options.quiet:
        print(f"{label}: a flight of {(flight.time - BOOT) / 1e6:.1f} s, to {contents_of(log)}")
    return DONE


def contents_of(log: UlogWriter) -> str:
    """Return what was written."""
    return f"{log.path}: {log.samples:,} samples, {number_of_bytes(log.size)}"


def _taken(path: str) -> InputError:
    return input_error(path, "R101", "there is such a file already: choose another name, or remove it", 0)


def _unwritable(path: str, error: Exception) -> InputError:
    reason = error.strerror if isinstance(error, OSError) else error
    return input_error(path, "R101", f"cannot be written: {reason}", 0)
