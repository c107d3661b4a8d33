"""Fields over time as lines of text: panels of braille dots and of bands, above one axis of time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from plotille import Canvas
from rich.cells import cell_len, set_cell_size
from rich.text import Text

from msggen.base.foreign import escaped
from msggen.recordings.log.plot import panels_of
from msggen.recordings.log.series import Band, Series
from msggen.recordings.log.thinning import thinned

if TYPE_CHECKING:
    from numpy.typing import NDArray

COLOURS = ("cyan", "yellow", "green", "magenta", "red", "blue")
_LETTERS = "abcdefghijklmnopqrstuvwxyz"
_LEAST = 3
"""The least rows of a panel of lines."""
_NARROWEST = 8
"""The least columns of a panel."""
_LONGEST = 24
"""The most columns of the names and numbers at the left."""
_MARGIN = 4
"""The columns at the right, where the letters of lines are."""
_TICK = 12
"""The least columns from one time on the axis to the next."""


class Plot(NamedTuple):
    """What is drawn: fields from one time in s to another, and those without a sample."""

    series: Sequence[Series]
    low: float
    high: float
    silent: Sequence[str] = ()


class _Panel(NamedTuple):
    """A panel, and how many of its rows are shown below the names of its fields."""

    series: Sequence[Series]
    bands: Sequence[Band]
    """The bands of a panel of values with names."""
    legend: Sequence[Text]
    rows: int


def draw(plot: Plot, width: int, height: int) -> list[Text]:
    """Return the lines of a plot, at most `height` of `width` columns."""
    notes = [Text(f"no sample yet: {escaped(', '.join(plot.silent))}", "dim")] if plot.silent else []
    panels, left_out = _fitted(panels_of(plot.series), width, height - len(notes) - 1)
    if left_out:
        notes.append(Text(f"no room for {escaped(', '.join(left_out))}", "yellow"))
    gutter = max([cell_len(label) for panel in panels for label in _labels(panel)], default=0)
    gutter = min(gutter, _LONGEST, max(0, width - _NARROWEST - 1))
    margin = _MARGIN if any(len(panel.series) > 1 for panel in panels) and width > 2 * (gutter + _NARROWEST) else 0
    inner = max(1, width - gutter - 1 - margin)
    lines = [line for panel in panels for line in _drawn(panel, plot, gutter, inner, has_ends=margin > 0)]
    axis = [_axis(plot, gutter, inner)] if panels else []
    lines = [*lines, *axis, *notes][: max(0, height)]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def _fitted(panels: Sequence[Sequence[Series]], width: int, room: int) -> tuple[list[_Panel], list[str]]:
    """Return the panels for which `room` lines are enough, and the labels of those that are left out."""
    found, least = list[_Panel](), 0
    for number, panel in enumerate(panels):
        bands = panel[0].bands if panel[0].is_named else ()
        rows = min(len(bands), max(1, room // 2)) if bands else _LEAST
        legend = _legend(panel, bands[rows:], width)
        least += len(legend) + rows
        if least > room - (number + 1 < len(panels)):  # the last line names those that are left out
            return _stretched(found, room - 1), [each.label for rest in panels[number:] for each in rest]
        found.append(_Panel(panel, bands, legend, rows))
    return _stretched(found, room), []


def _stretched(panels: Sequence[_Panel], room: int) -> list[_Panel]:
    """Give the lines that are left to the panels of lines."""
    of_lines = sum(not panel.bands for panel in panels)
    rest = room - sum(len(panel.legend) + panel.rows for panel in panels)
    shares = iter([rest // of_lines + (number < rest % of_lines) for number in range(of_lines)])
    return [panel if panel.bands else panel._replace(rows=panel.rows + next(shares)) for panel in panels]


def _labels(panel: _Panel) -> list[str]:
    """Return the texts at the left of a panel, a row each."""
    if panel.bands:
        return [escaped(band.name) for band in panel.bands[: panel.rows]]
    low, high = _range_of(panel.series)
    labels = [""] * panel.rows
    labels[0], labels[-1] = _number(high), _number(low)
    if panel.rows % 2 and panel.rows > _LEAST:
        labels[panel.rows // 2] = _number((low + high) / 2)
    return labels


def _range_of(panel: Sequence[Series]) -> tuple[float, float]:
    """Return the smallest and the largest number, or values around them if they are equal."""
    numbers = np.concatenate([each.values.astype(np.float64) for each in panel])
    numbers = numbers[np.isfinite(numbers)]
    if not numbers.size:
        return 0.0, 1.0
    low, high = float(numbers.min()), float(numbers.max())
    around = abs(low) / 10 or 1.0
    if math.isinf(high - low):  # floats that are too far apart for a difference
        return low / 2, high / 2
    return (low, high) if high > low else (low - around, high + around)


def _number(value: float) -> str:
    return f"{value:.5g}"


def _drawn(panel: _Panel, plot: Plot, gutter: int, inner: int, *, has_ends: bool) -> Iterator[Text]:
    """Yield the lines of a panel: the names of its fields, and its rows."""
    yield from panel.legend
    rows = _bands(panel, plot, inner) if panel.bands else _dots(panel, plot, inner)
    ends = _ends(panel) if has_ends and len(panel.series) > 1 else [Text()] * panel.rows
    for label, row, end in zip(_labels(panel), rows, ends, strict=True):
        front = Text(set_cell_size(" " * (gutter - cell_len(label)) + label, gutter) + "│")
        yield Text.assemble(front, row, end)


def _legend(panel: Sequence[Series], left_out: Sequence[Band], width: int) -> list[Text]:
    """Return lines with the names of fields and their newest values, in the colours of their lines.

    A name stands without its topic if the one before it has the same topic.
    """
    parts, last = list[Text](), ""
    for number, each in enumerate(panel):
        topic, _, field = each.name_in_legend.partition(".")
        name = field if topic == last else each.name_in_legend
        letter, last = f"{_letter(number)} " if len(panel) > 1 else "", topic
        style = "bold" if each.is_named else f"bold {_colour(number)}"
        parts.append(Text.assemble((f"{letter}{escaped(name)}", style), f" {_newest(each)}"))
    if panel[0].unit:
        parts.append(Text(f"[{escaped(panel[0].unit)}]"))
    if left_out:
        parts.append(Text(f"no room for {escaped(', '.join(band.name for band in left_out))}", "yellow"))
    return list(_wrapped(parts, width))


def _wrapped(parts: Sequence[Text], width: int) -> Iterator[Text]:
    """Yield lines of parts, with as many in each as fit."""
    line = parts[0]
    for part in parts[1:]:
        longer = Text.assemble(line, "   ", part)
        if longer.cell_len <= width:
            line = longer
        else:
            yield line
            line = part
    yield line


def _newest(series: Series) -> str:
    value = series.values[-1].item()
    if series.is_named:
        last = replace(series, times=series.times[-1:], values=series.values[-1:])
        return escaped("|".join([band.name for band in last.bands]))
    return _number(value) if series.values.dtype.kind == "f" else str(value)


def _letter(number: int) -> str:
    return _LETTERS[number % len(_LETTERS)]


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


def _dots(panel: _Panel, plot: Plot, inner: int) -> list[Text]:
    """Return the rows of a panel of lines: in braille, two dots across and four down in each character."""
    across, up = 2 * inner, 4 * panel.rows
    canvas = Canvas(inner, panel.rows, 0, 0, across, up)
    low, high = _range_of(panel.series)
    for number, each in enumerate(panel.series):
        times, values = _points(each, plot.high, across)
        xs = _places(times, plot.low, plot.high, across)
        ys = _places(values, low, high, up)
        _draw_line(canvas, xs.tolist(), ys.tolist(), np.isfinite(values).tolist(), _colour(number))
    text = canvas.plot("\n").replace("\u2800", " ")  # no dots, which some fonts draw as circles
    return [Text.from_ansi(line) for line in text.split("\n")]


def _points(series: Series, high: float, pixels: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the points that a line connects, of which it needs all. A value that is held makes steps."""
    values = series.values.astype(np.float64)
    values[~np.isfinite(values)] = np.nan
    kept = thinned(series.times, values, pixels)
    times, values = series.times[kept], values[kept]
    if series.is_held:
        times = np.append(np.repeat(times, 2)[1:], high)
        values = np.repeat(values, 2)
    return times, values


def _places(numbers: NDArray[Any], low: float, high: float, count: int) -> NDArray[np.intp]:
    """Return the dots of numbers: 0 for `low`, `count` - 1 for `high`. What is not finite is at 0."""
    shares = np.clip((numbers / 2 - low / 2) / max(high / 2 - low / 2, math.ulp(0.0)), 0.0, 1.0)
    places: NDArray[np.intp] = np.rint(np.nan_to_num(shares) * (count - 1)).astype(np.intp)
    return places


def _draw_line(canvas: Canvas, xs: Sequence[int], ys: Sequence[int], is_seen: Sequence[bool], colour: str) -> None:
    """Connect points with dots. The line is broken at those that are not seen, and a point alone is a dot."""
    last = None
    for x, y, seen in zip(xs, ys, is_seen, strict=True):
        if seen and (x, y) != last:
            begin = last or (x, y)
            canvas.line(*begin, x, y, color=colour)
        last = (x, y) if seen else None


def _ends(panel: _Panel) -> list[Text]:
    """Return the letters of the fields beside the rows in which their lines end."""
    low, high = _range_of(panel.series)
    ends = [Text(" ") for _ in range(panel.rows)]
    for number, each in enumerate(panel.series):
        value = float(each.values[-1])
        if math.isfinite(value):
            row = panel.rows - 1 - int(_places(np.array([value]), low, high, 4 * panel.rows)[0]) // 4
            ends[row].append(_letter(number), _colour(number))
    return ends


def _bands(panel: _Panel, plot: Plot, inner: int) -> list[Text]:
    """Return a row for each value with a name: full where the field has it."""
    rows = []
    for number, band in enumerate(panel.bands[: panel.rows]):
        cells = [" "] * inner
        for begin, end in band.spans:
            first, last = _places(np.array([begin, end]), plot.low, plot.high, inner).tolist()
            last = max(first + 1, last + (end >= plot.high))  # where a value ends, the next one begins
            cells[first:last] = "█" * (last - first)
        rows.append(Text("".join(cells), _colour(number)))
    return rows


def _axis(plot: Plot, gutter: int, inner: int) -> Text:
    """Return the line with the times in s since the start, below the place of each."""
    cells = [" "] * inner
    step = _step((plot.high - plot.low) / max(1, inner // _TICK))
    end = 0
    for number in range(math.ceil(plot.low / step), math.floor(plot.high / step) + 1):
        place = int(_places(np.array([number * step]), plot.low, plot.high, inner)[0])
        text = f"{number * step:g}"
        start = min(max(0, place - len(text) // 2), inner - len(text))
        if start >= end:
            cells[start : start + len(text)] = text
            end = start + len(text) + 1
    return Text(f"{'s':>{gutter}} {''.join(cells)}" if gutter else "".join(cells), "dim")


def _step(least: float) -> float:
    """Return the next of 1, 2, 5, 10 and so on."""
    power = 10.0 ** math.floor(math.log10(max(least, 1e-3)))
    return next((factor * power for factor in (1, 2, 5) if factor * power >= least), 10 * power)
