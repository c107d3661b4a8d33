"""What analysis finds in a flight, for the page of a report: step responses, spectra and histograms.

Their charts have axes of their own. A spectrogram is an image that follows the time of the other charts.
"""

from __future__ import annotations

import struct
import zlib
from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.finding import Unsaid
from msggen.analysis.motion import SENSORS, Sensor, motion_of
from msggen.analysis.outputs import outputs_of, thrust_of
from msggen.analysis.recorded import Column, Recorded
from msggen.analysis.response import Response, responses_of
from msggen.analysis.spectrum import Mark, Spectrogram, spectrogram_of, spectrum_of, windows_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LEVELS, _MOST_ROWS = 48, 160
"""The colours of an image, and the rows that it has at most."""
_ANCHORS = ((24, 18, 60), (42, 78, 138), (31, 148, 140), (130, 204, 90), (250, 236, 92))
"""Between these, in RGB, are the colours from the quietest to the loudest."""


class Axis(NamedTuple):
    """The horizontal axis of a chart that is not over time."""

    unit: str
    low: float
    high: float
    marks: Sequence[Mark] = ()


class Analysed(NamedTuple):
    """A chart with an axis of its own: labels and values of lines, and texts below it."""

    title: str
    unit: str
    lines: Sequence[tuple[str, Column]]
    axis: Axis
    notes: Sequence[str]


class Image(NamedTuple):
    """A spectrogram as an image, from the start to the end of the recording."""

    title: str
    unit: str
    address: str
    """The image itself, as `data:`."""
    highest: float
    """The frequency in Hz at the top. That at the bottom is 0."""
    marks: Sequence[Mark]
    note: str


Found = tuple[list[Analysed], list[Image], list[str]]


def analysed(recorded: Recorded) -> Found:
    """Return charts, images, and a text for each of those that the recording does not tell."""
    charts: list[Analysed] = []
    images: list[Image] = []
    missing: list[str] = []
    for title, responses in _responses(recorded):
        drawn = [each for each in responses if not each.verdict]
        if drawn:
            charts.append(_response_chart(title, drawn, [each.text for each in responses]))
        else:
            missing.append(_untold(title, [each.verdict for each in responses]))
    for sensor in SENSORS:
        title = f"Spectrum of the {sensor.title.lower()}"
        motion = motion_of(recorded, sensor)
        windows = motion if isinstance(motion, Unsaid) else windows_of(motion)
        if isinstance(windows, Unsaid):
            missing.append(_untold(title, [windows.reason]))
            continue
        spectrum = spectrum_of(recorded, windows)
        lines = [
            (name, Column(spectrum.frequencies[1:], values[1:], "dB", is_held=False, path=spectrum.path))
            for name, values in zip("xyz", spectrum.decibels, strict=True)
        ]
        axis = Axis("Hz", 0.0, spectrum.rate / 2, spectrum.marks)
        charts.append(Analysed(title, f"dB of {_density(sensor)}", lines, axis, [spectrum.text]))
        images.append(_image(spectrogram_of(recorded, windows)))
    charts += _histograms(recorded)
    return charts, images, missing


def _untold(title: str, reasons: Iterable[str]) -> str:
    return f"{title.lower()} ({'; '.join(dict.fromkeys(reasons))})"


def _density(sensor: Sensor) -> str:
    return f"({sensor.unit})²/Hz"


def _responses(recorded: Recorded) -> Iterator[tuple[str, list[Response]]]:
    found = responses_of(recorded)
    for unit, title in (("deg", "Step response of angles"), ("deg/s", "Step response of rates")):
        yield title, [each for each in found if each.loop.unit == unit]


def _response_chart(title: str, drawn: Sequence[Response], notes: Sequence[str]) -> Analysed:
    lines = [
        (each.loop.name, Column(each.times, each.mean, "", is_held=False, path=each.loop.measured[0])) for each in drawn
    ]
    return Analysed(title, "", lines, Axis("s", 0.0, float(drawn[0].times[-1])), notes)


def _histograms(recorded: Recorded) -> Iterator[Analysed]:
    thrust = thrust_of(recorded)
    notes = [] if isinstance(thrust, Unsaid) else [thrust.text]
    for outputs in outputs_of(recorded):
        lines = [
            (label, Column(outputs.edges[:-1], shares * 100, "%", is_held=True, path=outputs.path))
            for label, shares in zip(outputs.labels, outputs.shares, strict=True)
        ]
        axis = Axis("", float(outputs.edges[0]), float(outputs.edges[-1]))
        noun = outputs.path.partition(".")[0].removeprefix("actuator_")
        yield Analysed(f"Values of {noun}", "% of the flight", lines, axis, notes)
        notes = []


def _image(found: Spectrogram) -> Image:
    low, high = found.range
    density = found.density[1:][::-1]  # the highest frequency is at the top
    group = -(-len(density) // _MOST_ROWS)
    whole = len(density) - len(density) % group
    rows = density[:whole].reshape(-1, group, density.shape[1]).mean(axis=1)
    shares = (10 * np.log10(np.maximum(rows, 1e-20)) - low) / (high - low)
    levels = np.where(np.isnan(shares), 0, 1 + np.clip(np.nan_to_num(shares) * _LEVELS, 0, _LEVELS - 1))
    sensor = found.sensor
    note = f"{found.path}, {found.rate:.0f} Hz. Dark is {low:.0f} dB, and bright {high:.0f} dB; a gap has no colour."
    return Image(
        f"Spectrogram of the {sensor.title.lower()}",
        f"dB of {_density(sensor)}",
        f"data:image/png;base64,{b64encode(png(levels.astype(np.uint8))).decode()}",
        found.rate / 2,
        found.marks,
        note,
    )


def png(levels: NDArray[np.uint8]) -> bytes:
    """Return an image of the PNG format, of shape (rows, columns): 0 has no colour, 1 to 48 go from dark to bright."""
    places = np.linspace(0, len(_ANCHORS) - 1, _LEVELS)
    colours = np.stack([np.interp(places, range(len(_ANCHORS)), each) for each in zip(*_ANCHORS, strict=True)], axis=1)
    palette = bytes(3) + np.rint(colours).astype(np.uint8).tobytes()
    rows = np.concatenate([np.zeros((len(levels), 1), np.uint8), levels], axis=1)  # each row names its filter: none
    header = struct.pack(">IIBBBBB", levels.shape[1], levels.shape[0], 8, 3, 0, 0, 0)
    parts = (
        (b"IHDR", header),
        (b"PLTE", palette),
        (b"tRNS", b"\0"),
        (b"IDAT", zlib.compress(rows.tobytes(), 9)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(_part(kind, content) for kind, content in parts)


def _part(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
