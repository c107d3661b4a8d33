"""Tables of the results: printed with rich, and written as Markdown."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from statistics import geometric_mean
from typing import NamedTuple

from rich.console import Console
from rich.table import Table as RichTable

from codec import Speeds, Times
from columns import BACK, BUFFER, FIELDS, JOIN, LAZY, LIST, LOOP, PEERS_FOR_LAZY
from generation import Scale
from imports import OUR_IMPORTS, Starts
from memory import Sizes
from messages import Sample
from peers import FLOOR, OURS, PEERS

NONE = "–"  # noqa: RUF001 - stands for a missing number
MEAN = "geometric mean"


class Table(NamedTuple):
    """Rows of text with a head. The first column has names, the others numbers; the last rows may be means."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    means: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()

    def print(self) -> None:
        """Print the table and its notes: drawn in a terminal, otherwise as Markdown."""
        if sys.stdout.isatty():
            self.show(Console())
        else:
            print(f"### {self.title}\n\n{self.markdown()}\n", flush=True)

    def markdown(self) -> str:
        """Return the table and its notes as Markdown."""
        rule = [":--", *["--:"] * (len(self.head) - 1)]
        lines = [self.head, rule, *self.rows, *[[cell and f"**{cell}**" for cell in row] for row in self.means]]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        return "\n\n".join([table, *["\n".join(f"- {note}" for note in self.notes)] * bool(self.notes)])

    def show(self, console: Console) -> None:
        """Print the table and its notes."""
        shown = RichTable(title=self.title, title_justify="left", title_style="bold")
        for number, name in enumerate(self.head):
            shown.add_column(name, justify="right" if number else "left")
        for number, row in enumerate(self.rows, 1):
            shown.add_row(*row, end_section=number == len(self.rows))
        for row in self.means:
            shown.add_row(*row, style="bold")
        console.print(shown)
        for note in self.notes:
            console.print(f"  {note}", style="dim", highlight=False)
        console.print()


def times_as_fast(ratio: float) -> str:
    """Return a ratio as text: `5.7x`, `57x`."""
    return f"{ratio:.1f}x" if ratio < 9.95 else f"{ratio:.0f}x"  # noqa: PLR2004 - two significant digits


def nanoseconds(seconds: float) -> str:
    """Return a time as nanoseconds."""
    return f"{seconds * 1e9:,.0f}"


def milliseconds(seconds: float) -> str:
    """Return a time as milliseconds."""
    return f"{seconds * 1e3:.1f}"


def mean_ratio(times: Mapping[str, Mapping[str, float]], contestant: str, base: str) -> float:
    """Return the geometric mean of the ratio of `contestant` to `base`, over all messages that have both."""
    ratios = [by_name[contestant] / by_name[base] for by_name in times.values() if contestant in by_name]
    return geometric_mean(ratios) if ratios else 0.0


def codec_table(direction: str, samples: Sequence[Sample], speeds: Speeds) -> Table:
    """Return the table of a direction, "decode" or "encode"."""
    floor = {"decode": "of the unpack floor", "encode": "of pack alone"}[direction]
    peers = [peer.name for peer in PEERS]
    rows = []
    for sample in samples:
        times = speeds.times[sample.name]
        ours = times[OURS.name]
        compared = [times_as_fast(times[name] / ours) if name in times else NONE for name in peers]
        rows.append(
            [
                sample.name,
                str(len(sample.payload)),
                nanoseconds(ours),
                times_as_fast(ours / times[FLOOR.name]),
                *compared,
            ]
        )
    means = [times_as_fast(speeds.mean(name)) if speeds.mean(name) else NONE for name in peers]
    return Table(
        f"{direction}: time of msggen, and of the others as a multiple of it",
        ["message", "bytes", "msggen, ns", floor, *peers],
        rows,
        [[MEAN, "", "", times_as_fast(1 / speeds.mean(FLOOR.name)), *means]],
        [*(f"{peer.name} {peer.notes[direction]}." for peer in PEERS if direction in peer.notes), *reasons(speeds)],
    )


def reasons(speeds: Speeds) -> list[str]:
    """Return the reasons for missing numbers."""
    messages: dict[tuple[str, str], list[str]] = {}
    for (message, name), reason in speeds.missing.items():
        messages.setdefault((name, reason), []).append(message)
    return [f"{name} {reason}: {', '.join(found)}." for (name, reason), found in messages.items()]


def columns_table(speeds: Speeds) -> Table:
    """Return the table of conversions to columns."""
    loops = [LOOP, *(peer.name for peer in PEERS)]
    rows = []
    for message, times in speeds.times.items():
        batch = times[FIELDS]
        compared = [times_as_fast(times[name] / batch) if name in times else NONE for name in loops]
        rows.append([message, nanoseconds(batch), nanoseconds(times[OURS.name]), *compared])
    return Table(
        "batch to columns: ns for each sample, and the time of a loop as a multiple of decode_batch",
        ["message", "decode_batch, ns", "and batch.columns, ns", *loops],
        rows,
        [
            [f"{MEAN}, decode_batch", "", "", *(_mean(speeds.times, name, FIELDS) for name in loops)],
            [f"{MEAN}, with batch.columns", "", "", *(_mean(speeds.times, name, OURS.name) for name in loops)],
        ],
        [
            "A loop fills arrays with the shapes of those in `decode_batch`: two dimensions for `gyro_rad`.",
            "`batch.columns` makes one array for each element, such as `gyro_rad[0]`. OrbTestLarge has 514.",
            *reasons(speeds),
        ],
    )


def _mean(times: Times, contestant: str, base: str) -> str:
    ratio = mean_ratio(times, contestant, base)
    return times_as_fast(ratio) if ratio else NONE


def arrays_table(times: Times, bandwidth: float) -> Table:
    """Return the table of structured arrays."""
    rows = [
        [
            message,
            nanoseconds(by_name[JOIN]),
            nanoseconds(by_name[LIST]),
            times_as_fast(by_name[LIST] / by_name[JOIN]),
            f"{by_name[BUFFER] * 1e6:,.0f}",
            nanoseconds(by_name[BACK]),
        ]
        for message, by_name in times.items()
    ]
    return Table(
        "payloads to a structured array and back",
        ["message", "copy, ns", "decode_batch, ns", "of the copy", "from one buffer, us in total", "encode_batch, ns"],
        rows,
        [[MEAN, "", "", _mean(times, LIST, JOIN), "", ""]],
        [
            "The copy is `b''.join(payloads)`, for each sample. A single buffer is not copied.",
            f"This machine copies {bandwidth / 1e9:.1f} GB/s from one large block to another.",
        ],
    )


def lazy_table(times: Times) -> Table:
    """Return the table of reading one field."""
    others = [OURS.name, *PEERS_FOR_LAZY]
    rows = [
        [
            message,
            nanoseconds(by_name[LAZY]),
            *(times_as_fast(by_name[name] / by_name[LAZY]) if name in by_name else NONE for name in others),
        ]
        for message, by_name in times.items()
    ]
    return Table(
        "one field: time of the lazy view, and of decoding as a multiple of it",
        ["message", "lazy, ns", *(f"decode of {name}" for name in others)],
        rows,
        [[MEAN, "", *(_mean(times, name, LAZY) for name in others)]],
        ["The field is `timestamp`: `SensorCombined.lazy(data).timestamp`."],
    )


def starts_table(starts: Starts) -> Table:
    """Return the table of start-up times."""
    rows = [[f"`{OUR_IMPORTS[name]}`", milliseconds(took)] for name, took in starts.imports.items()]
    rows += [[f"{name}, a first SensorCombined decoded", milliseconds(took)] for name, took in starts.ready.items()]
    return Table(
        "start-up: time of a process above a bare interpreter",
        ["", "ms"],
        rows,
        notes=[f"The bare interpreter takes {milliseconds(starts.bare)} ms. Bytecode and cydr's codecs are cached."],
    )


def memory_table(sizes: Sizes) -> Table:
    """Return the table of memory."""
    names = [OURS.name, *(peer.name for peer in PEERS)]
    rows = [
        [message, *(f"{by_name[name]:,.0f}" if name in by_name else NONE for name in names)]
        for message, by_name in sizes.items()
    ]
    means = [
        f"{mean_ratio(sizes, name, OURS.name):.2f}" if mean_ratio(sizes, name, OURS.name) else NONE for name in names
    ]
    return Table(
        "memory: bytes of one decoded object",
        ["message", *names],
        rows,
        [[f"{MEAN}, msggen 1", *means]],
        ["Payloads are not counted. rosbags and mcap-ros2-support-fast keep them, because their arrays are views."],
    )


def commands_table(commands: Mapping[str, float]) -> Table:
    """Return the table of msggen's commands."""
    bare = next(iter(commands.values()))
    rows = [[name, milliseconds(took), milliseconds(took - bare)] for name, took in commands.items()]
    return Table("commands of msggen, as processes", ["", "ms", "above bare"], rows)


def scale_table(scales: Sequence[Scale]) -> Table:
    """Return the table of larger sets of messages."""
    rows = [
        [
            f"{scale.messages:,}",
            f"{scale.cold:.2f}",
            f"{scale.cold / scale.messages * 1e3:.2f}",
            f"{scale.again:.2f}",
            f"{scale.again / scale.messages * 1e3:.2f}",
        ]
        for scale in scales
    ]
    head = ["messages", "cold, s", "ms a message", "nothing changed, s", "ms a message"]
    return Table("generation of larger sets of messages", head, rows)
