"""Where a recording is from: the vehicle, its firmware, and its time in UTC, as far as a ULog tells them."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.base.recording_formats import FORMATS
from msggen.messages.earth import HAS_FIX
from msggen.recordings.columns.ordered import median

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from msggen.recordings.columns.samples import Samples
    from msggen.recordings.topics.topic import Topic

_GPS = ("sensor_gps", "vehicle_gps_position")
YEAR_2001 = 978_307_200_000_000
"""In us since 1970. Receivers that do not know the time tell earlier ones."""
_YEAR_2001_NS = YEAR_2001 * 1000
_LARGEST = (1 << 62) // 1000
_KINDS = ((255, ""), (192, "rc"), (128, "beta"), (64, "alpha"), (0, "dev"))
"""The smallest last byte of `ver_sw_release` of each kind of release, as PX4's version.h numbers them."""


class Firmware(NamedTuple):
    """The firmware of a vehicle."""

    release: str = ""
    """`v1.17.0`, or `v1.17.0-rc2` before the release; "" if it is not known."""
    commit: str = ""
    """The hash of the commit in git, "" if it is not known."""


def firmware_of(information: Mapping[str, object]) -> Firmware:
    """Return the firmware that wrote a ULog, from `ver_sw_release` and `ver_sw`."""
    release, commit = information.get("ver_sw_release"), information.get("ver_sw")
    return Firmware(
        release_text(release) if isinstance(release, int) and release else "", commit if isinstance(commit, str) else ""
    )


def release_text(number: int) -> str:
    """Return the release for `ver_sw_release`: `v1.17.0` for 0x011100ff.

    The last byte is 255 for a release, from 192 for release candidates, 128 for betas, 64 for alphas, 0 otherwise.
    """
    major, minor, patch, last = (number & 0xFFFFFFFF).to_bytes(4, "big")
    lowest, kind = next(each for each in _KINDS if last >= each[0])
    suffix = f"-{kind}{last - lowest or ''}" if kind else ""
    return f"v{major}.{minor}.{patch}{suffix}"


def vehicle_of(information: Mapping[str, object]) -> str:
    """Return the unique number of the vehicle's board (`sys_uuid`), "" if it is not known."""
    found = information.get("sys_uuid")
    return found if isinstance(found, str) else ""


def utc_offset_of(
    start: int, kind: str, information: Mapping[str, object], gps_offset: Callable[[], int | None]
) -> int | None:
    """Return what to add to log times in ns for UTC, None if the recording does not tell it.

    It is 0 for recordings whose log times are since 1970, also for a ULog of a simulator that counts so. Otherwise a
    ULog's times are since the start of the vehicle: the offset is from `boot_time_utc_us`, or else from `gps_offset`,
    which reads the samples of GPS receivers.
    """
    if start > _YEAR_2001_NS:
        return 0
    if not FORMATS[kind].is_of_vehicle:
        return None
    boot = information.get("boot_time_utc_us")
    if isinstance(boot, int) and YEAR_2001 < boot < _LARGEST:
        return boot * 1000
    return gps_offset()


def time_of_day(time: int, utc_offset: int | None) -> datetime | None:
    """Return a log time in UTC, None if it is not known."""
    if utc_offset is None:
        return None
    try:
        return datetime.fromtimestamp((time + utc_offset) // 10**9, timezone.utc)
    except (OverflowError, ValueError, OSError):
        return None


def gps_offset_of(topics: Sequence[Topic], samples_of: Callable[[Topic], Samples]) -> int | None:
    """Return what to add to log times in ns for the UTC of a GPS receiver, None if no receiver tells it.

    It is the median over all samples of a receiver that has a fix, or else only the time.
    """
    for topic in (topic for name in _GPS for topic in topics if topic.uorb == name):
        samples = samples_of(topic)
        rows = samples.array
        names = rows.dtype.names or ()
        if "time_utc_usec" not in names:
            continue
        utc = rows["time_utc_usec"].astype(np.int64)
        is_known = (utc > YEAR_2001) & (utc < _LARGEST)
        if "fix_type" in names and (is_known & (rows["fix_type"] >= HAS_FIX)).any():
            is_known &= rows["fix_type"] >= HAS_FIX
        if is_known.any():
            return int(median(utc[is_known] - samples.log_times[is_known] // 1000)) * 1000
    return None
