"""Charts as SVG. Equal numbers give equal files: text stays text, and there is no date."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

from codec import Speeds, Times
from columns import FIELDS, JOIN
from generation import Scale
from imports import Starts
from memory import Sizes
from peers import FLOOR, OURS, PEERS
from tables import mean_ratio, times_as_fast

COLOURS = {
    OURS.name: "#0072b2",
    "rosbags": "#d55e00",
    "mcap-ros2-support": "#cc79a7",
    "mcap-ros2-support-fast": "#e69f00",
    "pycdr2": "#8a8a8a",
    "cyclonedds": "#009e73",
    "cydr": "#56b4e9",
    FLOOR.name: "#333333",
    FIELDS: "#003f66",
    JOIN: "#333333",
}
"""The palette of Okabe and Ito, for readers with any colour vision."""

MARKERS = {
    OURS.name: "o",
    FIELDS: "D",
    JOIN: "|",
    "rosbags": "s",
    "mcap-ros2-support": "p",
    "mcap-ros2-support-fast": "^",
    "pycdr2": "X",
    "cyclonedds": "P",
    "cydr": "v",
}
SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "msggen",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.constrained_layout.h_pad": 0.1,
    "figure.constrained_layout.w_pad": 0.1,
}
"""Settings of matplotlib. The background is white, so that text is readable on a dark page."""


def draw(width: float, height: float, panels: int) -> tuple[Any, Any]:
    """Return a figure with its size in inches, and its panels side by side."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams.update(SETTINGS)
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, panels, figsize=(width, height), layout="constrained")
    return figure, axes


def svg(figure: Any) -> str:
    """Return a figure as text, and close it."""
    from matplotlib import pyplot as plt

    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()) + "\n"


def codec_chart(decode: Speeds, encode: Speeds) -> str:
    """Return the times of contestants compared with msggen: a bar for the mean, a dot for each message."""
    figure, panels = draw(9.5, 3.4, 2)
    for axes, speeds, title in zip(panels, (decode, encode), ("decode", "encode"), strict=True):
        names = [name for name in (FLOOR.name, OURS.name, *(peer.name for peer in PEERS)) if speeds.mean(name)]
        for place, name in enumerate(names):
            mean = speeds.mean(name)
            ratios = speeds.ratios(name)
            axes.barh(place, mean - LEFT, left=LEFT, color=COLOURS[name], height=0.62)
            if name != OURS.name:
                axes.plot(ratios, [place] * len(ratios), "o", color="white", markeredgecolor="black", markersize=3.2)
            axes.text(max(mean, *ratios, mean) * 1.25, place, times_as_fast(mean), va="center")
        axes.set_xscale("log")
        axes.set_xlim(LEFT, 700)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_title(f"{title}, time compared with msggen")
        axes.axvline(1, color="#0072b2", linewidth=0.8, linestyle=":")
        axes.xaxis.set_major_formatter(_plain)
    panels[1].set_yticklabels([])
    return svg(figure)


LEFT = 0.1
"""The start of bars on a logarithmic axis."""


def _plain(value: float, _place: int) -> str:
    return f"{value:g}x"


def columns_chart(speeds: Speeds, arrays: Times) -> str:
    """Return the time for each sample of the conversion to columns, message by message."""
    figure, axes = draw(9.5, 4.4, 1)
    messages = list(speeds.times)
    labels = {
        JOIN: "copy of the bytes",
        FIELDS: "msggen, decode_batch",
        OURS.name: "msggen, and columns",
        **{peer.name: f"loop over {peer.name}" for peer in PEERS},
    }
    for name, label in labels.items():
        rows = arrays if name == JOIN else speeds.times
        points = [(rows[message][name] * 1e9, place) for place, message in enumerate(messages) if name in rows[message]]
        axes.plot(
            [time for time, _ in points],
            [place for _, place in points],
            MARKERS[name],
            color=COLOURS[name],
            markersize=11 if name == JOIN else 7,
            markeredgewidth=2 if name == JOIN else 0.5,
            label=label,
        )
    axes.set_xscale("log")
    axes.set_yticks(range(len(messages)), messages)
    axes.set_ylim(len(messages) - 0.5, -0.5)
    axes.grid(axis="both", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title("from a list of payloads to columns, ns for each sample")
    axes.xaxis.set_major_formatter(lambda value, _place: f"{value:,.0f}")
    figure.legend(loc="outside right upper", frameon=False)
    return svg(figure)


def cost_chart(starts: Starts, sizes: Sizes) -> str:
    """Return the start-up time, and the memory of a message."""
    figure, (left, right) = draw(9.5, 2.8, 2)
    ready = {name: took * 1e3 for name, took in starts.ready.items()}
    means = {name: mean_ratio(sizes, name, OURS.name) for name in ready}
    _bars(left, ready, "until a first message is decoded, ms", "{:.0f}")
    _bars(right, means, "memory of a decoded message, msggen is 1", "{:.2f}")
    right.set_yticklabels([])
    return svg(figure)


def _bars(axes: Any, values: Mapping[str, float], title: str, form: str) -> None:
    for place, (name, value) in enumerate(values.items()):
        axes.barh(place, value, color=COLOURS[name], height=0.62)
        axes.text(value + max(values.values()) * 0.02, place, form.format(value), va="center")
    axes.set_yticks(range(len(values)), list(values))
    axes.set_xlim(0, max(values.values()) * 1.15)
    axes.invert_yaxis()
    axes.set_title(title)


def scale_chart(scales: Sequence[Scale]) -> str:
    """Return the time for each message of larger and larger sets: flat if the cost grows linearly."""
    figure, axes = draw(6.5, 2.8, 1)
    counts = [scale.messages for scale in scales]
    lines = {
        "cold": ([scale.cold / scale.messages * 1e3 for scale in scales], "o-", COLOURS[OURS.name]),
        "nothing changed": ([scale.again / scale.messages * 1e3 for scale in scales], "s--", COLOURS["rosbags"]),
    }
    for name, (values, style, colour) in lines.items():
        axes.plot(counts, values, style, color=colour)
        axes.annotate(name, (counts[-1], values[-1]), (8, 4), textcoords="offset points", color=colour)
    axes.set_xscale("log")
    axes.set_xticks(counts, [f"{count:,}" for count in counts])
    axes.minorticks_off()
    axes.set_xlim(counts[0] / 1.5, counts[-1] * 4)
    axes.set_ylim(0)
    axes.set_xlabel("messages")
    axes.set_title("generation, ms for each message")
    return svg(figure)
