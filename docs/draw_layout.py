"""Draw the bytes of a message: `python docs/draw_layout.py SensorCombined > docs/sensor_combined.svg`."""

from __future__ import annotations

import sys
from string import ascii_lowercase
from xml.sax.saxutils import escape

from msggen.definitions.layout import Leaf, lay_out
from msggen.sources.catalog import read_catalog
from msggen.sources.finding import find_sources

PER_ROW, CELL, ROW, LEFT, TOP = 16, 44, 46, 56, 64
STYLE = 'font-family="sans-serif" font-size="12"'
COLOURS = ("#cfe3f5", "#f6dfc2", "#d7ebd0", "#ecd6e9", "#f3ecb8", "#d3ebe9")


def draw(name: str) -> str:
    """Return an SVG picture of a sample of the embedded message `name`, with 16 bytes in a row."""
    catalog = read_catalog(find_sources(None))
    layout = lay_out(catalog, catalog.messages[f"px4_msgs/{name}"])
    rows = -(-layout.size // PER_ROW)
    legend = [(letter, leaf) for letter, leaf in zip(ascii_lowercase, layout.leaves, strict=False) if not _fits(leaf)]
    bottom = TOP + rows * ROW
    width, height = LEFT + PER_ROW * CELL + 12, bottom + 18 * len(legend) + 16
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" {STYLE}>',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        _text(LEFT, 22, f"{name}: header 00 01 00 00, then {layout.size} bytes", 'font-size="15" font-weight="bold"'),
    ]
    for column in range(PER_ROW):
        parts.append(_text(LEFT + (column + 0.5) * CELL, TOP - 10, str(column), 'text-anchor="middle" fill="#666"'))
    for row in range(rows):
        parts.append(_text(LEFT - 10, TOP + row * ROW + 25, str(row * PER_ROW), 'text-anchor="end" fill="#666"'))
    for index, (letter, leaf) in enumerate(zip(ascii_lowercase, layout.leaves, strict=False)):
        parts += _boxes(leaf, letter, COLOURS[index % len(COLOURS)])
    for line, (letter, leaf) in enumerate(legend):
        text = f"{letter}   {leaf.path[-1][0]}, {leaf.type}"
        parts.append(_text(LEFT + 4, bottom + 18 * line + 14, text, 'xml:space="preserve"'))
    return "\n".join([*parts, "</svg>"]) + "\n"


def _pieces(leaf: Leaf) -> list[tuple[int, int]]:
    """Return start and end of the field's part in each row that it touches."""
    start, end = leaf.offset, leaf.offset + leaf.element_count * leaf.size
    pieces = []
    while start < end:
        stop = min(end, (start // PER_ROW + 1) * PER_ROW)
        pieces.append((start, stop))
        start = stop
    return pieces


def _widest(leaf: Leaf) -> tuple[int, int]:
    return max(_pieces(leaf), key=lambda piece: piece[1] - piece[0])


def _fits(leaf: Leaf) -> bool:
    first, last = _widest(leaf)
    return len(leaf.path[-1][0]) * 6.6 < (last - first) * CELL


def _boxes(leaf: Leaf, letter: str, colour: str) -> list[str]:
    """Return a box for each row that the field touches; the widest has its name, or its letter in the legend."""
    boxes = []
    for first, last in _pieces(leaf):
        x, y, size = LEFT + first % PER_ROW * CELL, TOP + first // PER_ROW * ROW, (last - first) * CELL
        boxes.append(f'<rect x="{x}" y="{y}" width="{size}" height="{ROW - 6}" fill="{colour}" stroke="#888"/>')
        if (first, last) == _widest(leaf):
            lines = [leaf.path[-1][0], str(leaf.type)] if _fits(leaf) else [letter]
            top = y + (17 if len(lines) == 2 else 25)
            boxes += [_text(x + size / 2, top + 15 * n, line, 'text-anchor="middle"') for n, line in enumerate(lines)]
    return boxes


def _text(x: float, y: float, text: str, style: str) -> str:
    return f'<text x="{x:g}" y="{y:g}" {style}>{escape(text)}</text>'


if __name__ == "__main__":
    sys.stdout.write(draw(sys.argv[1]))
