"""Pictures of what analysis finds in a flight (matplotlib): a kind of picture for each row of `PICTURES`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.analysis.of_logs import (
    actuator_outputs,
    hover_thrust,
    innovations,
    sensor_spectrogram,
    sensor_spectrum,
    sources,
    step_responses,
)
from msggen.base.missing import installed_by
from msggen.recordings.columns.ordered import median
from msggen.recordings.log.plot import DPI, LITERAL, WIDTH, draw_modes
from msggen.recordings.log.series import read_modes, shown
from msggen.recordings.log.thinning import thinned
from msggen.recordings.source.source import RecordingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from msggen.analysis import Innovation, Mark, Outputs, Response, Spectrogram, Spectrum, Thrust
    from msggen.recordings.log.log import Log

_PANEL, _MARGIN = 2.6, 0.6
"""The heights of a panel and of all around the panels, in inches."""
_MOST_SOURCES = 16
"""The panels of innovations at most."""
_AXES = "xyz"
_LABEL = {"facecolor": "w", "alpha": 0.7, "lw": 0, "pad": 1}
"""The background of a text in a spectrogram."""


class Span(NamedTuple):
    """The part of a recording to draw, in s after its start; None is all of it."""

    start: float | None = None
    stop: float | None = None


class Panel(NamedTuple):
    """A part of a picture, and what it says in a line."""

    text: str
    draw: Callable[[Any], None]
    is_over_time: bool = False
    beside: Callable[[Any], None] | None = None
    """What is drawn to the right of it, on the same axis of values."""


class Picture(NamedTuple):
    """A kind of picture. `panels` returns its panels, and in texts what the recording does not tell."""

    about: str
    panels: Callable[[Log, Sequence[str], Span], tuple[Sequence[Panel], Sequence[str]]]
    columns: int = 1
    takes_sources: bool = False
    """Whether words after its name choose sensors or topics of sensors."""


ALL = Span()


def draw(
    log: Log, kind: str, words: Sequence[str] = (), span: Span = ALL, figure: Figure | None = None
) -> tuple[Figure | None, list[str], list[str]]:
    """Draw a kind of picture. Return the figure, what it says, and what the recording does not tell.

    There is no figure if the recording tells nothing of it. Raises RecordingError.
    """
    with installed_by("plot"):
        import matplotlib as mpl
        from matplotlib.figure import Figure as NewFigure
    picture = PICTURES[kind]
    panels, unsaid = picture.panels(log, words, span)
    if not panels:
        return None, [], list(unsaid)
    with mpl.rc_context(LITERAL):
        made = _drawn(log, picture, panels, span, figure or NewFigure())
    return made, [panel.text for panel in panels if panel.text], list(unsaid)


def _drawn(log: Log, picture: Picture, panels: Sequence[Panel], span: Span, figure: Figure) -> Figure:
    rows = -(-len(panels) // picture.columns)
    figure.set_size_inches(WIDTH, rows * _PANEL + _MARGIN)
    figure.set_dpi(DPI)
    figure.set_layout_engine("constrained")
    has_beside = any(panel.beside for panel in panels)
    columns = 2 if has_beside else picture.columns
    ratios = [4, 1] if has_beside else None
    grid = figure.subplots(rows, columns, squeeze=False, width_ratios=ratios)
    places = list(grid[:, 0]) if has_beside else list(grid.flat)
    low, high = span.start or 0.0, max(span.stop or log.duration, (span.start or 0.0) + 1e-3)
    modes = read_modes(log, start=span.start, stop=span.stop) if any(panel.is_over_time for panel in panels) else None
    for index, panel in enumerate(panels):
        axes = places[index]
        panel.draw(axes)
        axes.grid(visible=True, alpha=0.3)
        if panel.is_over_time:
            axes.set_xlim(low, high)
            axes.set_xlabel("time since the start [s]" if index == len(panels) - 1 else "")
            if modes is not None:
                draw_modes(axes, modes.since(low), low, high, is_top=not index)
        if has_beside:
            grid[index, 1].sharey(axes)
            grid[index, 1].tick_params(labelleft=False)
            if panel.beside:
                panel.beside(grid[index, 1])
    for axes in places[len(panels) :]:
        axes.set_visible(False)
    figure.suptitle(shown(os.path.basename(os.path.abspath(log.path))), fontsize="medium")
    return figure


# step responses


def _responses(log: Log, _: Sequence[str], span: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    found = step_responses(log, **span._asdict())
    if all(each.verdict for each in found):
        return (), [each.text for each in found]
    return [Panel(each.text, partial(_response, each)) for each in found], ()


def _response(found: Response, axes: Axes) -> None:
    axes.set_title(found.loop.name, fontsize="small")
    if found.verdict:
        axes.set_axis_off()
        words = found.verdict.replace(": ", ":\n").replace(", ", ",\n").replace("; ", ";\n")
        axes.text(0.5, 0.5, words, ha="center", va="center", fontsize="x-small", transform=axes.transAxes)
        return
    axes.fill_between(found.times, found.mean - found.spread, found.mean + found.spread, alpha=0.25, lw=0)
    axes.plot(found.times, found.mean, lw=1.2)
    axes.axhline(1.0, color="0.4", lw=0.8, ls="--")
    axes.set_xlim(0, found.times[-1])
    low, high = float(found.mean.min()), float(found.mean.max())
    axes.set_ylim(min(low, -0.1) - 0.1, max(high, 1.2) + 0.15)
    text = f"delay {found.delay * 1000:.0f} ms\novershoot {found.overshoot * 100:.0f} %\n{found.windows} windows"
    axes.text(0.97, 0.04, text, ha="right", va="bottom", fontsize="x-small", transform=axes.transAxes)
    axes.set_xlabel("time since the step [s]", fontsize="x-small")


# spectra


def _of_sources(
    log: Log, words: Sequence[str], span: Span, make: Callable[..., Any], panel: Callable[[Any], Panel]
) -> tuple[Sequence[Panel], Sequence[str]]:
    """Return a panel for each sensor that words choose, by default for all."""
    names = [
        (sensor.name, f"{topic or sensor.name}{f'[{instance}]' if instance else ''}")
        for word in words or ("gyro", "accel")
        for sensor, topic, instance in sources(word)
    ]
    panels, unsaid = [], []
    for sensor, source in names:
        try:
            panels.append(panel(make(log, source, sensor, **span._asdict())))
        except RecordingError as error:
            unsaid.append(f"{sensor}: {error}")
    return panels, unsaid


def _spectra(log: Log, words: Sequence[str], span: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    return _of_sources(log, words, span, sensor_spectrum, lambda found: Panel(found.text, partial(_spectrum, found)))


def _spectrum(found: Spectrum, axes: Axes) -> None:
    for name, values in zip(_AXES, found.decibels, strict=True):
        axes.plot(found.frequencies[1:], values[1:], lw=0.9, label=name)
    for mark in found.marks:
        for frequency in {mark.low, mark.high}:
            axes.axvline(frequency, color=_colour(mark), lw=0.8, ls="--")
        axes.axvspan(mark.low, mark.high, color=_colour(mark), alpha=0.12, lw=0)
        place: Any = axes.get_xaxis_transform()
        axes.text(mark.low, 0.98, mark.label, rotation=90, fontsize="x-small", va="top", ha="right", transform=place)
    axes.set_title(_source(found), fontsize="small")
    axes.set_xlim(0, found.rate / 2)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"density [dB of ({found.sensor.unit})²/Hz]", fontsize="small")
    axes.legend(loc="upper right", fontsize="small", ncols=3)


def _colour(mark: Mark) -> str:
    return "C3" if mark.label.startswith("motors") else "0.35"


def _source(found: Spectrum | Spectrogram) -> str:
    return f"{found.sensor.title} from {found.path}, {found.rate:.0f} Hz"


def _spectrograms(log: Log, words: Sequence[str], span: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    return _of_sources(
        log,
        words,
        span,
        sensor_spectrogram,
        lambda found: Panel(_source(found), partial(_spectrogram, found), is_over_time=True),
    )


def _spectrogram(found: Spectrogram, axes: Axes) -> None:
    values = found.decibels
    low, high = found.range
    image = axes.pcolormesh(
        found.edges, found.frequencies, values[:-1], cmap="viridis", vmin=low, vmax=high, rasterized=True, zorder=1
    )
    bar = axes.figure.colorbar(image, ax=axes, pad=0.01)
    bar.set_label(f"dB of ({found.sensor.unit})²/Hz", fontsize="x-small")
    place: Any = axes.get_yaxis_transform()
    style: dict[str, Any] = {"fontsize": "x-small", "transform": place, "bbox": _LABEL}
    for mark in found.marks:
        for frequency in {mark.low, mark.high}:
            axes.axhline(frequency, color="w" if _colour(mark) != "C3" else "C3", lw=0.8, ls="--")
        axes.text(0.995, mark.high, mark.label, va="center", ha="right", **style)
    axes.text(0.005, 0.97 * found.rate / 2, _source(found), va="top", **style)
    axes.set_ylabel("frequency [Hz]")


# actuators, thrust, innovations


def _line(axes: Axes, times: NDArray[np.float64], values: NDArray[np.float64], **style: Any) -> None:
    kept = thinned(times, values)
    axes.plot(times[kept], values[kept], lw=0.9, **style)


def _outputs(log: Log, _: Sequence[str], span: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    found = actuator_outputs(log, **span._asdict())
    unsaid = () if found else ["the recording has no actuator_motors, actuator_servos or actuator_outputs that change"]
    return [
        Panel("", partial(_output, each), is_over_time=True, beside=partial(_histograms, each)) for each in found
    ], unsaid


def _output(found: Outputs, axes: Axes) -> None:
    for label, values in zip(found.labels, found.values, strict=True):
        _line(axes, found.times, values, label=label, drawstyle="steps-post")
    axes.set_ylabel(found.path, fontsize="small")
    axes.legend(loc="upper right", fontsize="x-small", ncols=4)


def _histograms(found: Outputs, axes: Axes) -> None:
    for shares in found.shares:
        axes.stairs(shares * 100, found.edges, orientation="horizontal")
    axes.set_xlabel("share of the flight [%]", fontsize="x-small")


def _thrusts(log: Log, _: Sequence[str], span: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    try:
        found = hover_thrust(log, **span._asdict())
    except RecordingError as error:
        return (), [str(error)]
    return [Panel(found.text, partial(_thrust, found), is_over_time=True, beside=partial(_thrust_histogram, found))], ()


def _thrust(found: Thrust, axes: Axes) -> None:
    _line(axes, found.times, found.values, label="thrust")
    if np.isfinite(found.estimates).any():
        _line(axes, found.estimate_times, found.estimates, label="hover thrust, estimate")
    if np.isfinite(found.parameter):
        axes.axhline(found.parameter, color="0.4", lw=0.9, ls="--", label="MPC_THR_HOVER")
    axes.set_ylabel(found.path, fontsize="small")
    axes.legend(loc="upper right", fontsize="x-small", ncols=3)


def _thrust_histogram(found: Thrust, axes: Axes) -> None:
    axes.stairs(found.shares * 100, found.edges, orientation="horizontal", fill=True, alpha=0.6)
    if np.isfinite(found.hover):
        axes.axhline(found.hover, color="C1", lw=0.9)
    axes.set_xlabel("share of the flight [%]", fontsize="x-small")


def _innovations(log: Log, _: Sequence[str], __: Span) -> tuple[Sequence[Panel], Sequence[str]]:
    found = innovations(log)
    unsaid = () if found else ["the recording has no estimator_aid_src_… and no estimator_innovations"]
    kept = found[:_MOST_SOURCES]
    if len(found) > len(kept):
        unsaid = [f"{len(found) - len(kept)} more are left out: {', '.join(each.label for each in found[len(kept) :])}"]
    return [Panel(each.text, partial(_innovation, each), is_over_time=True) for each in kept], unsaid


def _innovation(found: Innovation, axes: Axes) -> None:
    kept = np.isfinite(found.gate)
    for sign in (-1, 1):
        _line(axes, found.times[kept], sign * found.gate[kept], color="C3", ls="--")
    _line(axes, found.times, found.values, color="C0")
    high = float(np.nanmax(np.abs(found.values)))
    middle = median(found.gate[kept]) if kept.any() else high
    axes.set_ylim(-1.2 * max(high, middle), 1.2 * max(high, middle))
    axes.set_ylabel(f"{found.label}{f' [{found.unit}]' if found.unit else ''}", fontsize="small")


PICTURES: Mapping[str, Picture] = MappingProxyType(
    {
        "step-response": Picture("how angles and rates follow their setpoints", _responses, columns=3),
        "spectrum": Picture("at which frequencies gyroscope and accelerometer move", _spectra, takes_sources=True),
        "spectrogram": Picture("the same over time", _spectrograms, takes_sources=True),
        "actuators": Picture("outputs over time, and how often each value occurs", _outputs),
        "thrust": Picture("the thrust against that at which the vehicle hovers", _thrusts),
        "innovations": Picture("what the estimator did not expect, with its gates", _innovations, columns=2),
    }
)
"""The kinds of pictures."""
