"""Pictures of recorded fields over time (matplotlib).

Fields of one unit share a panel. Values with names are drawn as bands, a row for each name, and so are bools. The
flight modes of the vehicle are the background of all panels, and its events are marked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.base.missing import installed_by
from msggen.definitions.unit import normalized_unit
from msggen.recordings.log.series import (
    LONGEST_VALUE,
    PIXELS,
    NoSamplesError,
    Series,
    parse_path,
    read_modes,
    read_series,
    shown,
)
from msggen.recordings.log.thinning import thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from msggen.recordings.log.log import Log

__all__ = [
    "ENDINGS",
    "NoSamplesError",
    "Series",
    "draw",
    "draw_panels",
    "draw_series",
    "panels_of",
    "parse_path",
    "read_series",
    "render",
    "thinned",
]

ENDINGS = ("png", "svg", "pdf")
"""The formats of files."""

WIDTH, _PANEL, _ROW, _MARGIN = 10.0, 2.2, 0.24, 1.1
"""The width of a picture, and the heights of a panel of lines, of a row of bands and of all around them, in inches."""
_LEGEND_WIDTH, _LETTER, _SAMPLE = 9.0, 0.07, 0.6
"""The width of a legend, of a letter in it, and of a line with the space beside it, in inches."""
_LEGEND_ROW, _LEGEND_EDGE = 0.2, 0.3
"""The height of a row of a legend, and of its edges with the axis of a panel, in inches."""
DPI = PIXELS / 2 / WIDTH
_MOST_NAMES = 16
"""The changes of flight mode up to which each one has its name in the picture."""
_MOST_EVENTS = 12
"""The events up to which all are marked; of more, those that are warnings or worse."""
_EVENT = 40
"""The length of the text at a mark."""
_CALM = ("notice", "info", "debug")
"""The levels of events that are no warnings."""
LITERAL = {"text.parse_math": False, "text.usetex": False, "axes.formatter.use_mathtext": False}
"""Settings of matplotlib with which texts are drawn as they are: names may have `$` in them."""


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


class Mark(NamedTuple):
    """An event, at a time in s after the start."""

    time: float
    text: str
    is_calm: bool
    """Whether it is no warning and no error."""


class Background(NamedTuple):
    """What is drawn behind fields: flight modes, and events."""

    modes: Series | None = None
    marks: Sequence[Mark] = ()


NOTHING = Background()


def draw_series(
    log: Log,
    series: Iterable[Series],
    *,
    start: float | None = None,
    stop: float | None = None,
    figure: Figure | None = None,
) -> Figure:
    """Draw fields that `read_series` has read of a recording for the same time. See `draw`."""
    title = os.path.basename(os.path.abspath(log.path))
    background = Background(read_modes(log, start=start, stop=stop), _marks(log))
    return draw_panels(list(series), title, start=start, background=background, figure=figure)


def _marks(log: Log) -> list[Mark]:
    """Return the decoded events that users read."""
    found = [event for event in log.events if event.is_text and event.group]
    return [Mark((event.time - log.start) / 1e9, event.text, event.level in _CALM) for event in found]


def draw_panels(
    series: Sequence[Series],
    title: str,
    *,
    start: float | None = None,
    background: Background = NOTHING,
    figure: Figure | None = None,
) -> Figure:
    """Draw fields over time from `start` on. See `draw`."""
    with installed_by("plot"):
        import matplotlib as mpl
        from matplotlib.figure import Figure as NewFigure
    with mpl.rc_context(LITERAL):  # each text takes it over when it is made
        low = start or _begin_of(series)
        return _drawn(series, title, low, background, figure or NewFigure())


def _drawn(series: Sequence[Series], title: str, low: float, background: Background, figure: Figure) -> Figure:
    """Draw fields into a figure, and return it."""
    panels = panels_of([each.since(low) for each in series])
    heights = [_height(panel) for panel in panels]
    figure.set_size_inches(WIDTH, sum(heights) + _MARGIN)
    figure.set_dpi(DPI)
    figure.set_layout_engine("constrained")
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})
    every: list[Axes] = list(grid[:, 0])
    modes = background.modes and background.modes.since(low)
    high = max(each.end for each in series)
    high = high if high > low else low + 1.0
    for axes, panel in zip(every, panels, strict=True):
        if panel[0].is_named:
            _draw_bands(axes, panel[0])
        else:
            _draw_lines(axes, panel)
        if modes is not None:
            draw_modes(axes, modes, low, high, is_top=axes is every[0])
    _draw_marks(every, [mark for mark in background.marks if low <= mark.time <= high], middle=(low + high) / 2)
    every[0].set_xlim(low, high)
    every[-1].set_xlabel("time since the start [s]")
    figure.suptitle(shown(title), fontsize="medium")
    return figure


def render(figure: Figure, ending: str) -> bytes:
    """Return a figure as a file of one of ENDINGS. Text in an SVG is text."""
    import matplotlib as mpl

    out = BytesIO()
    about = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[ending]
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "msggen"}):
        figure.savefig(out, format=ending, dpi=DPI, metadata=about)
    return out.getvalue()


def _begin_of(series: Iterable[Series]) -> float:
    """Return the time in s at which a picture begins: the start of the recording, unless all samples are older."""
    is_older = all(each.times[-1] < 0 for each in series)
    return min(float(each.times[0]) for each in series) if is_older else 0.0


def panels_of(series: Iterable[Series]) -> list[list[Series]]:
    """Return the series of each panel: one with names, or all of one unit, in the order of the first of each.

    Fields without a unit share a panel only with the other elements of their array.
    """
    panels: dict[str, list[Series]] = {}
    for each in series:
        unit = normalized_unit(each.unit)
        alone = each.label if each.is_named else "" if unit else re.sub(r"\[\d+\]$", "", each.label)
        panels.setdefault(f"{unit} {alone}", []).append(each)
    return list(panels.values())


def _height(panel: Sequence[Series]) -> float:
    if panel[0].is_named:
        return (len(panel[0].bands) + 1) * _ROW + 0.2
    return _PANEL + (_legend_shape(panel)[0] - 1) * _LEGEND_ROW


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
    axes.set_ylabel(f"[{shown(panel[0].unit)}]" if panel[0].unit else "")
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
    names = [shown(band.name, LONGEST_VALUE) for band in series.bands]
    axes.set_yticks(range(len(names)), names, fontsize="small")
    axes.set_ylim(-0.6, len(names) + 0.5)  # with a row for the label
    axes.text(
        0.008, len(names), shown(series.label), transform=axes.get_yaxis_transform(), fontsize="small", va="center"
    )


def draw_modes(axes: Axes, modes: Series, low: float, high: float, *, is_top: bool) -> None:
    """Draw the flight modes behind a panel of these times, with their names above the panel at the top."""
    colours = _colours(modes)
    changes = sum(len(band.spans) for band in modes.bands)
    for band in modes.bands:
        for begin, end in band.spans:
            axes.axvspan(begin, end, color=colours[band.name], alpha=0.25, lw=0, zorder=0, label=f"_{band.name}")
            is_seen = (min(end, high) - begin) * PIXELS > high - low
            if is_top and is_seen and changes <= _MOST_NAMES:
                style: dict[str, Any] = {"rotation": 30, "fontsize": "x-small", "ha": "left", "va": "bottom"}
                place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
                axes.annotate(
                    shown(band.name, LONGEST_VALUE), (begin, 1.0), (1, 2), annotation_clip=True, **place, **style
                )
    if is_top and changes > _MOST_NAMES:
        from matplotlib.patches import Patch

        patches = [Patch(color=colour, alpha=0.25, label=name) for name, colour in colours.items()]
        names = [shown(name, LONGEST_VALUE) for name in colours]
        _add_legend(axes.figure, patches, names, loc="outside right upper", fontsize="x-small")


def _draw_marks(every: Sequence[Axes], marks: Sequence[Mark], middle: float) -> None:
    """Draw events in all panels, with their texts in the lowest one. Of many, only those that are not calm."""
    found = marks if len(marks) <= _MOST_EVENTS else [mark for mark in marks if not mark.is_calm]
    for mark in found:
        colour = "0.35" if mark.is_calm else "C3"
        for axes in every:
            axes.axvline(mark.time, color=colour, lw=0.7, ls=":", label="_event")
        if len(found) <= _MOST_EVENTS:
            axes = every[-1]
            style: dict[str, Any] = {"rotation": 90, "fontsize": "x-small", "color": colour, "clip_on": True}
            place = axes.get_xaxis_transform()
            side = "left" if mark.time < middle else "right"  # so that no text is behind an edge
            axes.text(mark.time, 0.02, shown(mark.text, _EVENT), transform=place, ha=side, va="bottom", **style)


def _colours(modes: Series) -> Mapping[str, Any]:
    """Return the colour of each flight mode: the same one in all pictures."""
    import matplotlib as mpl

    shades = mpl.colormaps["tab20"]
    numbers = {name: value for value, name in modes.annotation.members.items()}
    return {band.name: shades(numbers.get(band.name, 0) * 7 % 20) for band in modes.bands}
