"""Many samples at once: to columns, to a structured array and back; and one field of each, through the lazy view.

A column is one array for each value of a message, with the name that pyulog gives it. Other packages have
no batches, so they are used in the loop that their users write, over the same samples.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from codec import Entries, Speeds, Times
from contest import execute, reason
from effort import Effort
from messages import Sample
from msggen.definitions.model import ArrayKind, FieldType, Message
from peers import OURS, PEERS, Peer
from rounds import Contestant, race, race_groups

Columns = dict[str, Any]
FIELDS = "decode_batch"
LOOP = "loop over msggen"
JOIN = "copy"
LIST, BUFFER, BACK = "list", "buffer", "encode_batch"
LAZY = "lazy"
SLICE = 10
"""Loops use one sample in this many."""

PEERS_FOR_LAZY = ("mcap-ros2-support-fast",)


class Place(NamedTuple):
    """A position in a loop: the variable of a message, and the statements that fill the arrays from it."""

    variable: str
    cell: str
    label: str
    indent: str
    shape: tuple[int, ...] = ()


class Loop:
    """A loop for a package without batches: arrays created in advance, filled sample by sample."""

    def __init__(self, sample: Sample, peer: Peer, decoded: Any) -> None:
        self.catalog, self.peer = sample.catalog, peer
        self.arrays: list[tuple[str, tuple[int, ...], str]] = []
        """Label, shape and type of each."""
        self.body: list[str] = []
        self._visit(sample.message, decoded, Place("message", "n", "", "        "))

    def program(self) -> str:
        """Return the text of a function `fill(payloads)`, which returns the arrays."""
        made = [
            f"    a{n} = empty((len(payloads), *{shape}), {dtype!r})" for n, (_, shape, dtype) in enumerate(self.arrays)
        ]
        names = ", ".join(f"a{n}" for n in range(len(self.arrays)))
        lines = [
            "from numpy import empty, frombuffer",
            "def fill(payloads):",
            *made,
            "    for n, data in enumerate(payloads):",
            f"        message = {self.peer.decode}",
            *self.body,
            f"    return ({names},)",
        ]
        return "\n".join(lines)

    def _visit(self, message: Message, decoded: Any, place: Place) -> None:
        for field in message.fields:
            value, expression = getattr(decoded, field.name), f"{place.variable}.{field.name}"
            is_array = field.type.array is ArrayKind.FIXED
            label = f"{place.label}{field.name}{'[{}]' if is_array else ''}"
            shape = (*place.shape, field.type.length) if is_array else place.shape
            if field.type.is_primitive:
                source = f"frombuffer({expression}, 'uint8')" if isinstance(value, bytes) else expression
                self.body.append(f"{place.indent}a{len(self.arrays)}[{place.cell}] = {source}")
                self.arrays.append((label, shape, self._dtype(field.type)))
                continue
            number = len(self.body)
            inner, indent, cell = self.catalog.nested(message, field.type), place.indent, place.cell
            if is_array:
                self.body.append(f"{indent}for i{number}, m{number} in enumerate({expression}):")
                value, indent, cell = value[0], f"{indent}    ", f"{cell}, i{number}"
            else:
                self.body.append(f"{indent}m{number} = {expression}")
            self._visit(inner, value, Place(f"m{number}", cell, f"{label}.", indent, shape))

    def _dtype(self, type_: FieldType) -> str:
        if type_.name == "char" and self.peer.signed_char:
            return "int8"
        return {"char": "uint8", "byte": "uint8"}.get(type_.name, type_.name)

    def columns(self, filled: Sequence[Any]) -> Columns:
        """Return views of the arrays as columns, with the names of `px4_types.batch.columns`."""
        return {
            label.format(*index): array[(slice(None), *index)]
            for (label, shape, _), array in zip(self.arrays, filled, strict=True)
            for index in np.ndindex(shape)
        }


def measure_columns(samples: Sequence[Sample], entries: Entries, effort: Effort) -> Speeds:
    """Return the time for each sample from bytes to columns, or to fields, of the batch and of loops."""
    ready: dict[str, dict[str, Contestant]] = {}
    missing: dict[tuple[str, str], str] = {}
    for sample in samples:
        payloads = sample.varied(effort.payloads)
        few = payloads[: effort.payloads // SLICE]
        batch = {**_names(entries, sample), "columns": batch_columns(), "payloads": payloads}
        ours = Contestant("columns(Type.decode_batch(payloads))", batch)
        ready[sample.name] = {OURS.name: ours, FIELDS: Contestant("Type.decode_batch(payloads)", batch)}
        expected = evaluate(ours)
        for peer in (OURS, *PEERS):
            entry = entries[sample.name][peer.name].decode
            loop = entry if isinstance(entry, str) else _loop(sample, peer, entry, few, expected)
            if isinstance(loop, str):
                missing[sample.name, peer.name] = loop
            else:
                ready[sample.name][LOOP if peer is OURS else peer.name] = loop
    best = race_groups(ready, max(2, effort.rounds // 6), effort.turn)
    counts = {
        message: {name: len(loop.names["payloads"]) for name, loop in loops.items()} for message, loops in ready.items()
    }
    times = {
        message: {name: took / counts[message][name] for name, took in by_name.items()}
        for message, by_name in best.items()
    }
    return Speeds(times, missing)


def _loop(
    sample: Sample, peer: Peer, decode: Contestant, payloads: Sequence[bytes], expected: Columns
) -> Contestant | str:
    """Return the loop over `peer`, after comparing its columns, or the reason why there is none."""
    names = {**decode.names, "payloads": payloads}
    try:
        loop = Loop(sample, peer, evaluate(decode))
        execute(loop.program(), names)
        contestant = Contestant("fill(payloads)", names)
        check_columns(loop.columns(evaluate(contestant)), expected)
    except Exception as error:  # noqa: BLE001 - an error of one peer must not stop the others
        return reason(error)
    return contestant


def batch_columns() -> Any:
    """Return `px4_types.batch.columns`; the package can be imported once a program of msggen has run."""
    return importlib.import_module("px4_types.batch").columns


def evaluate(contestant: Contestant) -> Any:
    """Return the result of a contestant's statement."""
    return eval(contestant.statement, dict(contestant.names))  # noqa: S307 - written by this module


def check_columns(found: Columns, expected: Columns) -> None:
    """Raise ValueError unless all columns are equal."""
    if found.keys() != expected.keys():
        raise ValueError("other columns")
    for name, column in found.items():
        if not np.array_equal(column.view(expected[name].dtype), expected[name][: len(column)]):
            raise ValueError(f"another column {name}")


def _names(entries: Entries, sample: Sample) -> Mapping[str, Any]:
    """Return the names that msggen's program for a sample defines."""
    entry = entries[sample.name][OURS.name].decode
    if isinstance(entry, str):
        raise TypeError(f"{sample.name}: {entry}")
    return entry.names


def measure_arrays(samples: Sequence[Sample], entries: Entries, effort: Effort) -> Times:
    """Return the time for each sample of copying the bytes, of `decode_batch` and of `encode_batch`.

    A buffer is not copied, so its time does not depend on the number of samples, and is not divided by it.
    """
    statements = {
        JOIN: 'b"".join(payloads)',
        LIST: "Type.decode_batch(payloads)",
        BUFFER: "Type.decode_batch(buffer)",
        BACK: "Type.encode_batch(array)",
    }
    ready = {}
    for sample in samples:
        payloads = sample.varied(effort.payloads)
        names = {**_names(entries, sample), "payloads": payloads, "buffer": b"".join(payloads)}
        names["array"] = names["Type"].decode_batch(payloads)
        if names["Type"].encode_batch(names["array"]) != payloads:
            raise ValueError(f"{sample.name}: encode_batch does not return the input of decode_batch")
        ready[sample.name] = {name: Contestant(statement, names) for name, statement in statements.items()}
    best = race_groups(ready, effort.rounds, effort.turn)
    return {
        message: {name: took if name == BUFFER else took / effort.payloads for name, took in by_name.items()}
        for message, by_name in best.items()
    }


def copy_bandwidth(effort: Effort) -> float:
    """Return the bytes per second that this machine copies between two blocks far larger than its caches."""
    source = bytes(range(250)) * effort.payloads * 20  # zeros may not occupy memory
    size = len(source)
    names = {"source": source, "target": memoryview(bytearray(size))}
    return size / race({JOIN: Contestant("target[:] = source", names)}, effort.rounds, effort.turn)[JOIN]


def measure_lazy(entries: Entries, effort: Effort) -> Times:
    """Return the time to read only `timestamp`, from the view and from whole messages."""
    ready = {}
    for message, by_peer in entries.items():
        contestants = {}
        for name, entry in by_peer.items():
            if name in (OURS.name, *PEERS_FOR_LAZY) and isinstance(entry.decode, Contestant):
                contestants[name] = Contestant(f"{entry.decode.statement}.timestamp", entry.decode.names)
        contestants[LAZY] = Contestant("Type.lazy(data).timestamp", contestants[OURS.name].names)
        ready[message] = contestants
    return race_groups(ready, effort.rounds, effort.turn)
