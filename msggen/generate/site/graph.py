"""The graph of messages that nest others, laid out in columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from msggen.generate.render.views import MessageView

_WIDTH, _HEIGHT = 250, 30
_ACROSS, _DOWN = 340, 40
_SPACE = 16
"""Sizes in pixels: those of a node, the distances of columns and of nodes in one, and the space between groups."""


class Node(NamedTuple):
    """A message, drawn as a box whose upper left corner is (x, y)."""

    message: MessageView
    x: int
    y: int
    width: int = _WIDTH
    height: int = _HEIGHT

    @property
    def text_y(self) -> int:
        """The base line of the name."""
        return self.y + 20


class Edge(NamedTuple):
    """A line from a message to one that it nests."""

    outer: Node
    inner: Node

    @property
    def path(self) -> str:
        """The line, as SVG has it."""
        (x, y), (to_x, to_y) = (self.outer.x + _WIDTH, self.outer.y + 15), (self.inner.x, self.inner.y + 15)
        middle = (x + to_x) // 2
        return f"M{x} {y}C{middle} {y} {middle} {to_y} {to_x} {to_y}"


class Graph(NamedTuple):
    """A drawing of the graph."""

    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    width: int
    height: int


def draw(messages: Iterable[MessageView]) -> Graph:
    """Return the drawing of those `messages` that nest others or are nested, one connected group below the other."""
    outers = [message for message in messages if inner_of(message)]
    nodes: dict[MessageView, Node] = {}
    top = 0
    for group in _groups(outers):
        columns: dict[int, list[MessageView]] = {}
        for message, column in _columns(group).items():
            columns.setdefault(column, []).append(message)
        for column, stacked in columns.items():
            for index, message in enumerate(_beside_outers(stacked, group, nodes)):
                nodes[message] = Node(message, column * _ACROSS, top + index * _DOWN)
        top += max(map(len, columns.values())) * _DOWN + _SPACE
    edges = [Edge(nodes[outer], nodes[inner]) for outer in outers for inner in inner_of(outer)]
    width = max((node.x for node in nodes.values()), default=0) + _WIDTH
    return Graph(tuple(nodes.values()), tuple(edges), width, max(top - _SPACE, 0))


def inner_of(message: MessageView) -> tuple[MessageView, ...]:
    """Return the messages that fields of `message` hold, each once, in the order of the fields."""
    return tuple(dict.fromkeys(field.message for field in message.fields if field.message))


def _groups(outers: list[MessageView]) -> Iterator[list[MessageView]]:
    """Yield the messages that are connected with each other, in the order of the first of `outers` in each group."""
    neighbours: dict[MessageView, list[MessageView]] = {}
    for outer in outers:
        for inner in inner_of(outer):
            neighbours.setdefault(outer, []).append(inner)
            neighbours.setdefault(inner, []).append(outer)
    seen: set[MessageView] = set()
    for start in outers:
        waiting, group = [start], []
        while waiting:
            message = waiting.pop(0)
            if message not in seen:
                seen.add(message)
                group.append(message)
                waiting += neighbours[message]
        if group:
            yield group


def _columns(group: list[MessageView]) -> dict[MessageView, int]:
    """Return the column of each message: to the right of all messages that nest it."""
    columns = dict.fromkeys(group, 0)
    waiting = list(group)
    while waiting:
        outer = waiting.pop()
        for inner in inner_of(outer):
            if columns[inner] <= columns[outer]:
                columns[inner] = columns[outer] + 1
                waiting.append(inner)
    return dict(sorted(columns.items(), key=lambda item: item[1]))


def _beside_outers(
    stacked: list[MessageView], group: list[MessageView], nodes: dict[MessageView, Node]
) -> list[MessageView]:
    """Return the messages of a column, sorted by the mean height of the messages that nest them."""

    def height(message: MessageView) -> tuple[float, str]:
        above = [nodes[outer].y for outer in group if outer in nodes and message in inner_of(outer)]
        return (sum(above) / len(above) if above else 0, message.name)

    return sorted(stacked, key=height)
