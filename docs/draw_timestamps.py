"""Draw what the bridge does to timestamps: `python docs/draw_timestamps.py > docs/timestamps.svg`."""

from __future__ import annotations

import sys
from typing import NamedTuple
from xml.sax.saxutils import escape

OFFSET = 1_790_000_000_000_000
"""The agent's clock minus the vehicle's, in us."""

NOW = 12_000_000
"""The vehicle's clock."""

WIDTH, ROW, LEFT, RIGHT, BOX = 900, 40, 20, 640, 240
STYLE = 'font-family="sans-serif" font-size="13"'
OUT, IN, SAME = "#d7ebd0", "#cfe3f5", "#eeeeee"


class Line(NamedTuple):
    """A field, its value in us on both sides, what the bridge does, and a colour."""

    name: str
    px4: int
    bridge: str
    dds: int
    colour: str


def sent(time: int) -> int:
    """Return a top-level timestamp that PX4 sends, as it arrives in DDS."""
    return time + OFFSET


def received(time: int) -> int:
    """Return a top-level timestamp from DDS, as it arrives in PX4."""
    return min(time - OFFSET, NOW) if time else NOW


def lines() -> tuple[list[Line], list[Line]]:
    """Return what PX4 sends, and what it receives."""
    late, early = sent(NOW + 5_000), sent(NOW - 20_000)
    out = [
        Line("timestamp", NOW, "plus offset", sent(NOW), OUT),
        Line("timestamp_sample", NOW - 4_000, "plus offset", sent(NOW - 4_000), OUT),
        Line("any other field, and nested messages", NOW - 90_000, "unchanged", NOW - 90_000, SAME),
    ]
    into = [
        Line("timestamp, timestamp_sample", received(early), "minus offset", early, IN),
        Line("the same: 0 means now", received(0), "becomes the vehicle's clock", 0, IN),
        Line("the same: later than now", received(late), "becomes the vehicle's clock", late, IN),
        Line("any other field, and nested messages", NOW - 90_000, "unchanged", NOW - 90_000, SAME),
    ]
    return out, into


def draw() -> str:
    """Return an SVG picture with a row for each kind of field, PX4 on the left and DDS on the right."""
    out, into = lines()
    clocks = f"vehicle {_spaced(NOW)} since boot, agent {_spaced(sent(NOW))} since 1970, offset {_spaced(OFFSET)}"
    parts = [
        _text(LEFT, 24, "What the bridge does to times, in us", 'font-size="16" font-weight="bold"'),
        _text(LEFT, 46, f"Clocks: {clocks}", 'fill="#444"'),
    ]
    top = 80
    for title, rows, is_out in (("PX4 sends: /fmu/out/...", out, True), ("PX4 receives: /fmu/in/...", into, False)):
        parts.append(_text((LEFT + BOX + RIGHT) / 2, top, title, 'text-anchor="middle" font-weight="bold"'))
        parts.append(_text(LEFT + BOX, top, "in PX4", 'text-anchor="end" fill="#666"'))
        parts.append(_text(RIGHT + BOX, top, "in DDS and ROS 2", 'text-anchor="end" fill="#666"'))
        for index, line in enumerate(rows):
            parts += _row(line, top + 12 + index * ROW, is_out=is_out)
        top += len(rows) * ROW + 50
    height = top - 20
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" {STYLE}>',
            f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
            *parts,
            "</svg>\n",
        ]
    )


def _row(line: Line, y: int, *, is_out: bool) -> list[str]:
    """Return both boxes with the value, and the arrow between them."""
    box = f'width="{BOX}" height="{ROW - 8}" fill="{line.colour}" stroke="#888"'
    start, end = (LEFT + BOX + 10, RIGHT - 10) if is_out else (RIGHT - 10, LEFT + BOX + 10)
    tip = end - 8 if is_out else end + 8
    middle = y + (ROW - 8) // 2
    return [
        f'<rect x="{LEFT}" y="{y}" {box}/>',
        f'<rect x="{RIGHT}" y="{y}" {box}/>',
        _text(LEFT + BOX - 8, y + 20, _spaced(line.px4), 'text-anchor="end"'),
        _text(RIGHT + BOX - 8, y + 20, _spaced(line.dds), 'text-anchor="end"'),
        f'<line x1="{start}" y1="{middle}" x2="{tip}" y2="{middle}" stroke="#444"/>',
        f'<path d="M {end} {middle} L {tip} {middle - 4} L {tip} {middle + 4} Z" fill="#444"/>',
        _text((start + end) / 2, middle - 5, line.bridge, 'text-anchor="middle"'),
        _text((start + end) / 2, middle + 14, line.name, 'text-anchor="middle" fill="#666" font-size="11"'),
    ]


def _spaced(number: int) -> str:
    return f"{number:,}".replace(",", "\u2009")


def _text(x: float, y: float, text: str, style: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" {style}>{escape(text)}</text>'


if __name__ == "__main__":
    sys.stdout.write(draw())
