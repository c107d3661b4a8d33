"""Pictures of recorded fields over time (matplotlib).

Fields of one unit share a panel. Values with names are drawn as bands, a row for each name, and so are bools. The
flight modes of the vehicle are the background of all panels.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.base.diagnostics import few, printable, shortened, suggestion
from msggen.definitions.unit import normalized_unit
from msggen.recordings.columns.annotations import Annotation, annotation_of
from msggen.recordings.columns.arrays import names_of
from msggen.recordings.source.source import RecordingError
from msggen.recordings.topics.choice import listed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Log
    from msggen.recordings.topics.topic import Topic

ENDINGS = ("png", "svg", "pdf")
"""The formats of files."""
MODES = "vehicle_status", "nav_state"
"""The topic and the field with the flight modes."""

_WIDTH, _PANEL, _ROW, _MARGIN = 10.0, 2.2, 0.24, 1.1
"""The width of a picture, and the heights of a panel of lines, of a row of bands and of all around them, in inches."""
_LEGEND_WIDTH, _LETTER, _SAMPLE = 9.0, 0.07, 0.6
"""The width of a legend, of a letter in it, and of a line with the space beside it, in inches."""
_LEGEND_ROW, _LEGEND_EDGE = 0.2, 0.3
"""The height of a row of a legend, and of its edges with the axis of a panel, in inches."""
_DPI = 100
_PIXELS = 2 * round(_WIDTH * _DPI)
"""The number of points on the time axis that are told apart: two for each pixel of a PNG."""
_MOST_BANDS = 64
"""The rows that bands have at most: a field with more values is drawn as a line."""
_MOST_NAMES = 16
"""The changes of flight mode up to which each one has its name in the picture."""
_LONGEST, _LONGEST_VALUE = 60, 40
"""The most characters of a text that are drawn, and of the name of a value."""
_LITERAL = {"text.parse_math": False, "text.usetex": False, "axes.formatter.use_mathtext": False}
"""Settings of matplotlib with which texts are drawn as they are: names may have `$` in them."""
_PATH = re.compile(r"(?P<topic>[^.\[\]]+)(?:\[(?P<instance>\d{1,3})\])?\.(?P<field>.+)")


class NoSamplesError(RecordingError):
    """Fields whose topics have no samples in the time that was asked for."""

    def __init__(self, paths: Sequence[str], text: str) -> None:
        super().__init__(text)
        self.paths = paths


@dataclass(frozen=True)
class Band:
    """The times in s at which a field has a value."""

    name: str
    spans: tuple[tuple[float, float], ...]
    """Begin and end of each stretch, without those that follow closer than a pixel."""


@dataclass(frozen=True)
class Series:
    """A field over time, as it is drawn."""

    label: str
    times: NDArray[np.float64]
    """In s after the start of the recording."""
    values: NDArray[Any]
    annotation: Annotation
    end: float
    """The time in s at which it ends: its last sample, or if the values have names, the usual interval later."""

    @property
    def unit(self) -> str:
        """The unit, "" for a number without one and for a field whose unit is not known."""
        return "" if self.annotation.unit == "-" else self.annotation.unit

    @property
    def is_named(self) -> bool:
        """Whether the values have names, and are few."""
        if self.values.dtype == bool or self.annotation.is_flags:
            return True
        return bool(self.annotation.members) and len(np.unique(self.values)) <= _MOST_BANDS

    @property
    def name_in_legend(self) -> str:
        """The label, with a note on a line that cannot be seen."""
        is_seen = self.is_held or bool(np.isfinite(self.values).any())
        return _shown(self.label) + ("" if is_seen else " (never a finite number)")

    @property
    def is_held(self) -> bool:
        """Whether a value lasts until the next sample: all but floats."""
        return self.values.dtype.kind != "f"

    def since(self, begin: float) -> Series:
        """Return the same field without the samples before a time in s.

        The last of these is moved to this time, if its value lasts until then or there is no later sample.
        """
        first = int(np.searchsorted(self.times, begin))
        if first == len(self.times) or (first and self.is_held and self.times[first] > begin):
            first -= 1
        times = np.maximum(self.times[first:], begin)
        return replace(self, times=times, values=self.values[first:], end=max(self.end, begin))

    @property
    def bands(self) -> tuple[Band, ...]:
        """The bands of a field whose values have names, in the order of the values; only of those that occur."""
        names = self.annotation.members
        if self.values.dtype == bool:
            found: list[tuple[str, NDArray[np.bool_]]] = [("false", ~self.values), ("true", self.values)]
        elif self.annotation.is_flags:
            flags = _unsigned(self.values)
            found = [(name, flags & bit == bit) for bit, name in self._bits.items()]
            found.append((names.get(0, "none"), self.values == 0))
        else:
            found = [(names.get(int(each), str(each)), self.values == each) for each in np.unique(self.values)]
        return tuple(Band(name, self._spans(mask)) for name, mask in found if mask.any())

    @property
    def _bits(self) -> dict[int, str]:
        """The flags that occur and their names, `bit 29` for a bit without a name."""
        every = int(np.bitwise_or.reduce(_unsigned(self.values)))
        bits = {1 << bit: f"bit {bit}" for bit in range(every.bit_length())}
        named = {**bits, **self.annotation.members}
        return {flag: named[flag] for flag in sorted(named) if flag > 0 and flag & every == flag}

    def _spans(self, mask: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
        """Return begin and end of each stretch in which `mask` is set; those without a pixel between them are one."""
        edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
        ends = np.append(self.times, self.end)
        begin, stop = ends[np.flatnonzero(edges == 1)], ends[np.flatnonzero(edges == -1)]
        apart = begin[1:] - stop[:-1] > (self.end - self.times[0]) / _PIXELS
        begin, stop = begin[np.append(True, apart)], stop[np.append(apart, True)]
        return tuple(zip(begin.tolist(), stop.tolist(), strict=True))


def read_series(
    log: Log, paths: Iterable[str], *, start: float | None = None, stop: float | None = None
) -> list[Series]:
    """Return fields of a recording by paths such as `vehicle_status.nav_state` and `sensor_gps[1].eph`.

    The topic ends at the first `.`, and has the number of its instance in brackets. A field that is an array or a
    message stands for all of its numbers. Raises RecordingError for a path that there is not, and for text, and
    NoSamplesError for all paths without samples.
    """
    wanted = {path: parse_path(log, path) for path in listed(paths)}
    loaded = log.load({topic.label: topic for topic, _ in wanted.values()}.values(), start=start, stop=stop)
    chosen = {path: loaded[topic.key].choose([name]) for path, (topic, name) in wanted.items()}
    empty = [path for path, samples in chosen.items() if not len(samples)]
    if empty:
        names = few(list(dict.fromkeys(chosen[path].topic.label for path in empty)))
        time = "" if start is None and stop is None else " in this time"
        raise NoSamplesError(empty, f"there are no samples of {names}{time}")
    found = []
    for path, samples in chosen.items():
        topic, _ = wanted[path]
        times = (samples.log_times - log.start) / 1e9
        front = topic.uorb + (f"[{topic.instance}]" if topic.instance else "")
        for column, values in samples.columns().items():
            if values.dtype == object:
                raise RecordingError(f"{front}.{column} has no fixed size, and is not drawn")
            about = annotation_of(topic, column)
            series = Series(f"{front}.{column}", times, values, about, float(times[-1]))
            if stop is not None and topic.last > samples.log_times[-1]:  # the last value lasts until a later sample
                series = replace(series, end=stop)
            elif series.is_named:
                series = replace(series, end=_end_of(series, stop))
            found.append(series)
    return found


def _end_of(series: Series, stop: float | None) -> float:
    """Return until when the last value lasts: for the median interval. Samples long before the start do not count."""
    times = series.times if series.end < 0 else series.since(0.0).times
    usual = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return min(float(times[-1]) + usual, inf if stop is None else stop)


def read_modes(log: Log, *, start: float | None = None, stop: float | None = None) -> Series | None:
    """Return the flight modes of a recording, None if it does not have them. Those without a name have a number."""
    try:
        modes = read_series(log, [".".join(MODES)], start=start, stop=stop)[0]
    except RecordingError:
        return None
    numbered = {value: f"{MODES[1]} {value}" for value in np.unique(modes.values).tolist()}
    about = modes.annotation._replace(members={**numbered, **modes.annotation.members})
    return replace(modes, annotation=about, end=max(modes.end, _end_of(modes, stop)))


def draw(
    log: Log,
    paths: Sequence[str],
    *,
    start: float | None = None,
    stop: float | None = None,
    figure: Figure | None = None,
) -> Figure:
    """Draw fields of a recording over time. Return the figure, by default a new one without a window.

    `paths` are as `read_series` takes them, `start` and `stop` in s after the start. Raises RecordingError.
    """
    series = read_series(log, paths, start=start, stop=stop)
    return draw_series(log, series, start=start, stop=stop, figure=figure)


def draw_series(
    log: Log,
    series: Iterable[Series],
    *,
    start: float | None = None,
    stop: float | None = None,
    figure: Figure | None = None,
) -> Figure:
    """Draw fields that `read_series` has read of a recording for the same time. See `draw`."""
    import matplotlib as mpl
    from matplotlib.figure import Figure as NewFigure

    with mpl.rc_context(_LITERAL):  # each text takes it over when it is made
        return _drawn(log, list(series), start, stop, figure or NewFigure())


def _drawn(log: Log, series: Sequence[Series], start: float | None, stop: float | None, figure: Figure) -> Figure:
    """Draw fields into a figure, and return it."""
    low = start or _begin_of(series)
    panels = list(_panels(each.since(low) for each in series))
    heights = [_height(panel) for panel in panels]
    figure.set_size_inches(_WIDTH, sum(heights) + _MARGIN)
    figure.set_dpi(_DPI)
    figure.set_layout_engine("constrained")
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
    every: list[Axes] = list(grid[:, 0])
    modes = read_modes(log, start=start, stop=stop)
    modes = modes and modes.since(low)
    high = max(each.end for each in series)
    high = high if high > low else low + 1.0
    for axes, panel in zip(every, panels, strict=True):
        if panel[0].is_named:
            _draw_bands(axes, panel[0])
        else:
            _draw_lines(axes, panel)
        if modes is not None:
            _draw_modes(axes, modes, low, high, is_top=axes is every[0])
    every[0].set_xlim(low, high)
    every[-1].set_xlabel("time since the start [s]")
    figure.suptitle(_shown(os.path.basename(os.path.abspath(log.path))), fontsize="medium")
    return figure


def render(figure: Figure, ending: str) -> bytes:
    """Return a figure as a file of one of ENDINGS. Text in an SVG is text."""
    import matplotlib as mpl

    out = BytesIO()
    about = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[ending]
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "msggen"}):
        figure.savefig(out, format=ending, dpi=_DPI, metadata=about)
    return out.getvalue()


def thinned(times: NDArray[np.float64], values: NDArray[Any]) -> NDArray[np.intp]:
    """Return the indices of the samples that a line needs, in order: all of them if they are few.

    Of the samples in each pixel they are the first, the last, the smallest, the largest and the first that is no
    number. So the line has every peak, and it is broken wherever the line of all samples is.
    """
    count = len(times)
    if count <= 4 * _PIXELS or times[-1] <= times[0]:
        return np.arange(count)
    pixels = ((times - times[0]) * ((_PIXELS - 1) / (times[-1] - times[0]))).astype(np.intp)
    starts = np.append(np.flatnonzero(np.append(True, pixels[1:] != pixels[:-1])), count)
    kept = [starts[:-1], starts[1:] - 1]
    missing = np.isnan(values)
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        part, gaps = values[begin:end], missing[begin:end]
        if gaps.any():
            kept.append(np.array([begin + int(gaps.argmax())]))
            if gaps.all():
                continue
            kept.append(begin + np.array([np.nanargmin(part), np.nanargmax(part)]))
        else:
            kept.append(begin + np.array([part.argmin(), part.argmax()]))
    return np.unique(np.concatenate(kept))


def parse_path(log: Log, path: str) -> tuple[Topic, str]:
    """Return the topic and the field of a path. Raises RecordingError."""
    found = _PATH.fullmatch(path)
    if found is None:
        name = path.partition("[")[0]
        if "." in path or name not in log:
            near = suggestion(name, [topic.uorb for topic in log.topics]) if "." not in path else ""
            raise RecordingError(f"expected TOPIC.FIELD or TOPIC[INSTANCE].FIELD, found '{path}'{near}")
        columns = names_of(log.dtype(name))
        raise RecordingError(f"'{path}' is a topic: name one of its fields, such as {few(columns)}")
    instance = found["instance"]
    return log.topic(found["topic"], None if instance is None else int(instance)), found["field"]


def _begin_of(series: Iterable[Series]) -> float:
    """Return the time in s at which a picture begins: the start of the recording, unless all samples are older."""
    is_older = all(each.times[-1] < 0 for each in series)
    return min(float(each.times[0]) for each in series) if is_older else 0.0


def _unsigned(values: NDArray[Any]) -> NDArray[Any]:
    return values.view(values.dtype.str.replace("i", "u"))


def _panels(series: Iterable[Series]) -> Iterator[list[Series]]:
    """Yield the series of each panel: one with names, or all of one unit, in the order of the first of each.

    Fields without a unit share a panel only with the other elements of their array.
    """
    panels: dict[str, list[Series]] = {}
    for each in series:
        unit = normalized_unit(each.unit)
        alone = each.label if each.is_named else "" if unit else re.sub(r"\[\d+\]$", "", each.label)
        panels.setdefault(f"{unit} {alone}", []).append(each)
    yield from panels.values()


def _height(panel: Sequence[Series]) -> float:
    if panel[0].is_named:
        return (len(panel[0].bands) + 1) * _ROW + 0.2
    return _PANEL + (_legend_shape(panel)[0] - 1) * _LEGEND_ROW


def _shown(text: str, longest: int = _LONGEST) -> str:
    """Return a text of a recording as it is drawn."""
    return shortened(printable(text), longest, longest // 2)


def _draw_lines(axes: Axes, panel: Sequence[Series]) -> None:
    for each in panel:
        values = each.values.astype(np.float64)
        values[~np.isfinite(values)] = np.nan
        kept = thinned(each.times, values)
        style = "steps-post" if each.is_held else "default"
        alone = np.flatnonzero(_is_alone(values[kept]))
        axes.plot(
            each.times[kept],
            values[kept],
            label=each.name_in_legend,
            lw=0.9,
            drawstyle=style,
            marker="." if alone.size else "",
            markevery=alone.tolist(),
        )
    axes.set_ylabel(f"[{_shown(panel[0].unit)}]" if panel[0].unit else "")
    exponent = axes.yaxis.get_offset_text()
    exponent.set(horizontalalignment="right", fontsize="x-small")  # the names of flight modes are to the right of it
    axes.margins(x=0)
    axes.grid(visible=True, alpha=0.3)
    _draw_legend(axes, panel)


def _is_alone(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which values are numbers between others that are not: a line does not show them."""
    is_number = np.concatenate(([False], ~np.isnan(values), [False]))
    return is_number[1:-1] & ~is_number[:-2] & ~is_number[2:]


def _draw_legend(axes: Axes, panel: Sequence[Series]) -> None:
    """Draw a legend in rows above the lines, for which the axis of the values becomes longer."""
    rows, columns = _legend_shape(panel)
    share = (rows * _LEGEND_ROW + _LEGEND_EDGE) / _height(panel)
    low, high = axes.get_ylim()
    axes.set_ylim(low, low + (high - low) / (1 - share))
    names = [each.name_in_legend for each in panel]
    _add_legend(axes, axes.lines, names, loc="upper right", fontsize="small", ncols=columns, borderaxespad=0.3)


def _add_legend(owner: Axes | Figure | SubFigure, handles: Sequence[Any], names: Sequence[str], **style: Any) -> None:
    """Draw a legend. Names are set when it is there: labels that begin with `_` are left out of it."""
    legend = owner.legend(handles, [" "] * len(names), **style)
    for text, name in zip(legend.get_texts(), names, strict=True):
        text.set_text(name)


def _legend_shape(panel: Sequence[Series]) -> tuple[int, int]:
    """Return the rows and columns of a legend that is not wider than its panel."""
    longest = max(len(each.name_in_legend) for each in panel)
    columns = min(max(int(_LEGEND_WIDTH / (longest * _LETTER + _SAMPLE)), 1), len(panel))
    return -(-len(panel) // columns), columns


def _draw_bands(axes: Axes, series: Series) -> None:
    for row, band in enumerate(series.bands):
        spans = [(begin, end - begin) for begin, end in band.spans]
        axes.broken_barh(spans, (row - 0.4, 0.8), facecolor=f"C{row % 10}", edgecolor="face", label=band.name)
    names = [_shown(band.name, _LONGEST_VALUE) for band in series.bands]
    axes.set_yticks(range(len(names)), names, fontsize="small")
    axes.set_ylim(-0.6, len(names) + 0.5)  # with a row for the label
    axes.text(
        0.008, len(names), _shown(series.label), transform=axes.get_yaxis_transform(), fontsize="small", va="center"
    )


def _draw_modes(axes: Axes, modes: Series, low: float, high: float, *, is_top: bool) -> None:
    """Draw the flight modes behind a panel of these times, with their names above the panel at the top."""
    colours = _colours(modes)
    changes = sum(len(band.spans) for band in modes.bands)
    for band in modes.bands:
        for begin, end in band.spans:
            axes.axvspan(begin, end, color=colours[band.name], alpha=0.25, lw=0, zorder=0, label=f"_{band.name}")
            is_seen = (min(end, high) - begin) * _PIXELS > high - low
            if is_top and is_seen and changes <= _MOST_NAMES:
                style: dict[str, Any] = {"rotation": 30, "fontsize": "x-small", "ha": "left", "va": "bottom"}
                place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
                axes.annotate(
                    _shown(band.name, _LONGEST_VALUE), (begin, 1.0), (1, 2), annotation_clip=True, **place, **style
                )
    if is_top and changes > _MOST_NAMES:
        from matplotlib.patches import Patch

        patches = [Patch(color=colour, alpha=0.25, label=name) for name, colour in colours.items()]
        names = [_shown(name, _LONGEST_VALUE) for name in colours]
        _add_legend(axes.figure, patches, names, loc="outside right upper", fontsize="x-small")


def _colours(modes: Series) -> Mapping[str, Any]:
    """Return the colour of each flight mode: the same one in all pictures."""
    import matplotlib as mpl

    shades = mpl.colormaps["tab20"]
    numbers = {name: value for value, name in modes.annotation.members.items()}
    return {band.name: shades(numbers.get(band.name, 0) * 7 % 20) for band in modes.bands}
