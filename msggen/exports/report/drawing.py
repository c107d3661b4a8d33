"""The track of a flight as a drawing: paths of SVG in m, x to the east and y to the south."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from msggen.analysis.compare import SIDES
from msggen.recordings.log.thinning import spread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.analysis.figures import Track
    from msggen.analysis.timeline import Timeline

MOST = 4000
"""The most points of a track."""
_PIXELS = 4000
"""The number of places in a bar that are told apart."""
_SMALLEST = 2.0
"""The smallest side of a drawing in m."""
_NARROWEST = 0.5
"""The smallest height of a drawing, and the smallest width, as shares of the other one."""
_UNKNOWN = 8
"""The colour of stretches whose mode is not known."""
_LINES = 8
"""About how many lines the grid has on the longer side."""


class Path(NamedTuple):
    """A stretch that was flown in one mode."""

    name: str
    colour: int
    points: str


class Drawing(NamedTuple):
    """A track, as the template sees it. `box` is that of SVG: left, top, width and height."""

    box: str
    grid: str
    paths: Sequence[Path]
    begin: str
    end: str
    caption: str
    label: str


class _Box(NamedTuple):
    left: float
    top: float
    width: float
    height: float


def drawing_of(track: Track, timeline: Timeline) -> Drawing:
    """Return the drawing of a track, in the colours of the flight modes."""
    kept = spread(track.times, MOST)
    times, right, down = track.times[kept], track.east[kept], -track.north[kept]
    text = (
        f"The green ring is the first position, the red dot the last one; the colours are those of the flight modes. "
        f"From {track.source}."
    )
    return _drawing([(right, down)], list(_paths(times, right, down, timeline)), text)


def drawing_of_flights(tracks: Sequence[tuple[str, Track]], *, is_common: bool) -> Drawing:
    """Return the drawing of the tracks of several flights, each in a colour of its own.

    `is_common`: whether they are at their places on earth, and do not all begin in the middle.
    """
    kept = [spread(track.times, MOST // len(tracks)) for _, track in tracks]
    lines = [(track.east[at], -track.north[at]) for (_, track), at in zip(tracks, kept, strict=True)]
    names = [name for name, _ in tracks]
    paths = [Path(name, SIDES.index(name), f"M{_line(*line)}") for name, line in zip(names, lines, strict=True)]
    text = "A green ring is a first position, a red dot the last one; A is blue, B is orange. "
    text += "Both are at their places on earth." if is_common else "Each begins at its own first position."
    return _drawing(lines, paths, text)


def _drawing(
    lines: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], paths: Sequence[Path], text: str
) -> Drawing:
    right, down = np.concatenate([right for right, _ in lines]), np.concatenate([down for _, down in lines])
    box = _box(right, down)
    step = _nice(max(box.width, box.height) / _LINES)
    wide, high = np.ptp(right), np.ptp(down)
    return Drawing(
        " ".join(f"{each:.9g}" for each in box),
        _grid(box, step),
        paths,
        "".join(f"M{_point(right[0], down[0])}h0" for right, down in lines),
        "".join(f"M{_point(right[-1], down[-1])}h0" for right, down in lines),
        f"From above, north is up. A square of the grid is {step:g} m wide. {text}",
        f"The track: {wide:.0f} m from west to east, {high:.0f} m from south to north",
    )


def bars(spans: Sequence[tuple[float, float]], width: float) -> str:
    """Return spans of time as bars of height 1. Those with less than a pixel between them are one."""
    joined: list[list[float]] = []
    for begin, end in spans:
        if joined and begin - joined[-1][1] < width / _PIXELS:
            joined[-1][1] = end
        else:
            joined.append([begin, end])
    return "".join(f"M{begin:.3f} 0H{end:.3f}V1H{begin:.3f}z" for begin, end in joined)


def _paths(
    times: NDArray[np.float64], right: NDArray[np.float64], down: NDArray[np.float64], timeline: Timeline
) -> Iterator[Path]:
    """Yield a path for each mode, and for the time in which the mode is not known. Each ends where the next begins."""
    edges = sorted({float(times[0]), *(time for each in timeline.modes for time in (each.begin, each.end))})
    for begin, end in zip(edges, [*edges[1:], np.inf], strict=True):
        first, last = np.searchsorted(times, [begin, end])
        if first == last:
            continue
        points = _line(right[first : last + 1], down[first : last + 1])
        name = timeline.mode_at(begin)
        yield Path(name or "flight mode not known", timeline.colours.get(name, _UNKNOWN), f"M{points}")


def _line(right: NDArray[np.float64], down: NDArray[np.float64]) -> str:
    return "L".join(map(_point, right, down))


def _point(right: float, down: float) -> str:
    return f"{right:.2f} {down:.2f}"


def _box(right: NDArray[np.float64], down: NDArray[np.float64]) -> _Box:
    """Return the box around all points, with a margin, not too narrow and not too flat."""
    wide, high = max(float(np.ptp(right)), _SMALLEST), max(float(np.ptp(down)), _SMALLEST)
    wide, high = max(wide, high * _NARROWEST), max(high, wide * _NARROWEST)
    wide, high = wide * 1.12, high * 1.12
    middle, centre = (float(each.min() + each.max()) / 2 for each in (right, down))
    return _Box(middle - wide / 2, centre - high / 2, wide, high)


def _grid(box: _Box, step: float) -> str:
    """Return the lines of the grid, also beside the box: the drawing can be wider or higher than that."""
    wide = high = 2 * max(box.width, box.height)
    left, top = box.left + box.width / 2 - wide / 2, box.top + box.height / 2 - high / 2
    upright = np.arange(np.ceil(left / step), (left + wide) / step) * step
    level = np.arange(np.ceil(top / step), (top + high) / step) * step
    lines = [f"M{each:.9g} {top:.9g}v{high:.9g}" for each in upright]
    return "".join([*lines, *(f"M{left:.9g} {each:.9g}h{wide:.9g}" for each in level)])


def _nice(length: float) -> float:
    """Return the next larger of 1, 2, 5, 10, 20, 50 and so on."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(next(power * each for each in (1, 2, 5, 10) if power * each >= length * 0.999))
