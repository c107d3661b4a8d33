"""Samples of a channel as rows of a numpy array. Samples that do not fit its definition are left out and counted."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msggen.recordings.decode.encapsulation import HEADER, USUAL
from msggen.recordings.decode.left_out import Missing, leave_out
from msggen.recordings.source.gather import at
from msggen.recordings.source.rows import Layout
from msggen.recordings.source.source import Channel, Part, SchemaError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msggen.recordings.decode.schemas import Schema
    from msggen.recordings.source.memory import Octets

    Rows = NDArray[Any]


class Decoded(NamedTuple):
    """Rows of a part."""

    rows: Rows
    """Rows of a fixed size are bytes (`V208`), so that numpy copies their padding. `Decoder.dtype` has their fields."""
    kept: NDArray[np.intp] | None
    """The indices in the part of the samples that the rows are of, None for all."""


class Decoder:
    """Decodes the samples of one channel. Raises SchemaError if its definition cannot be read."""

    def __init__(self, channel: Channel) -> None:
        if not channel.is_decoded:
            raise SchemaError(f"samples in '{channel.encoding}', expected cdr")
        if channel.layout is None and not channel.definition:
            other = channel.definition_format
            raise SchemaError(
                f"its definition is in '{other}', expected ros2msg" if other else "the recording has no definition"
            )
        self._channel = channel
        self.layout: Layout | None = channel.layout
        self._schema: Schema | None = None
        if channel.layout is None:  # the modules that read definitions take longer to import than most ULogs to read
            from msggen.recordings.decode.layouts import layout_of
            from msggen.recordings.decode.schemas import read_schema

            self._schema = read_schema(channel.ros_type, channel.definition)
            if self._schema.is_static:
                self.layout = layout_of(channel.ros_type, channel.definition)
        self.dtype: np.dtype[Any] = self._dtype()
        self._sample = _void(self.layout.size if self.layout else 0)
        self._row = _void(self.dtype.itemsize)

    def rows(self, part: Part, missing: Missing | None = None) -> Decoded:
        """Return the rows of a part. The log times of samples that are left out are added to `missing`."""
        if self._channel.layout is not None:
            return self._of_size(part, self._channel.layout, missing)
        if self.layout is None:
            return self._one_by_one(part, missing)
        found = self._usual(part, self.layout)
        return self._mixed(part, self._kinds(part), self.layout, missing) if found is None else Decoded(found, None)

    def _usual(self, part: Part, layout: Layout) -> Rows | None:
        """Return the rows of samples that are all of the right size and in little-endian XCDR1, otherwise None."""
        sizes = part.sizes
        if not sizes.size or np.minimum.reduce(sizes) < layout.size:
            return None
        if np.maximum.reduce(sizes) > layout.size + layout.surplus:
            return None
        samples = at(part.buffer, self._sample)[part.starts]
        kinds: NDArray[np.uint16] = np.ndarray(len(samples), "<u2", samples, 0, layout.size)
        return self._rows_of(samples, layout) if np.logical_and.reduce(kinds == _USUAL_NUMBER) else None

    # encapsulations

    def _kinds(self, part: Part) -> NDArray[np.uint16]:
        """Return the first two bytes of the samples as numbers, with those of unknown encapsulations 0xFFFF."""
        kinds = np.full(len(part.starts), _UNKNOWN, np.uint16)
        has_header = part.sizes >= HEADER
        kinds[has_header] = at(part.buffer, "<u2")[part.starts[has_header]]
        return kinds

    def _mixed(self, part: Part, kinds: NDArray[np.uint16], layout: Layout, missing: Missing | None) -> Decoded:
        """Return the rows of samples of which some are not in little-endian XCDR1."""
        from msggen.recordings.decode.layouts import ENCODINGS

        rows = np.zeros(len(part.starts), self._row)
        is_kept = np.zeros(len(part.starts), bool)
        for number in np.unique(kinds).tolist():
            of_kind = np.flatnonzero(kinds == number)
            encapsulation = int(number).to_bytes(2, "little")
            times = part.log_times[of_kind]
            chosen = part._replace(starts=part.starts[of_kind], sizes=part.sizes[of_kind], log_times=times)
            if encapsulation == USUAL:
                found = self._of_size(chosen, layout, missing)
            elif encapsulation in ENCODINGS:
                found = self._converted(chosen, encapsulation, layout, missing)
            else:
                leave_out(missing, f"encapsulation {encapsulation.hex(' ')}, expected CDR", times)
                continue
            of_kind = of_kind if found.kept is None else of_kind[found.kept]
            rows[of_kind] = found.rows
            is_kept[of_kind] = True
        if is_kept.all():
            return Decoded(rows, None)
        kept = np.flatnonzero(is_kept)
        return Decoded(rows[kept], kept)

    def _converted(self, part: Part, encapsulation: bytes, layout: Layout, missing: Missing | None) -> Decoded:
        """Return the rows of samples in another encapsulation than the usual one."""
        from msggen.recordings.decode.layouts import ENCODINGS, wire_of

        assert self._schema is not None  # noqa: S101 - only CDR has encapsulations
        wire = wire_of(self._schema, encapsulation)
        kept = _fitting(part, wire.size, layout.surplus, missing)
        starts = part.starts if kept is None else part.starts[kept]
        samples = _gathered(part.buffer, starts, wire.size)
        for offset, size in wire.delimiters:
            order, _ = ENCODINGS[encapsulation]
            given = samples[:, offset : offset + 4].copy().view(f"{order}u4").ravel()
            fits = given == size
            if not fits.all():
                times = part.log_times if kept is None else part.log_times[kept]
                leave_out(missing, "delimiter headers of another size", times[~fits])
                samples = samples[fits]
                kept = np.flatnonzero(fits) if kept is None else kept[fits]
        rows = np.zeros(len(samples), self._row)
        octets = _octets(rows)
        if layout.in_place:
            octets[:, :2] = np.frombuffer(USUAL, np.uint8)
        if len(rows):
            octets[:, layout.positions] = samples[:, wire.positions]
        self._normalize_bools(rows, layout)
        return Decoded(rows, kept)

    # samples of one size

    def _of_size(self, part: Part, layout: Layout, missing: Missing | None) -> Decoded:
        kept = _fitting(part, layout.size, layout.surplus, missing)
        starts = part.starts if kept is None else part.starts[kept]
        samples = at(part.buffer, self._sample)[starts]
        return Decoded(self._rows_of(samples, layout), kept)

    def _rows_of(self, samples: NDArray[np.void], layout: Layout) -> Rows:
        """Return the rows of usual samples. They can be the same memory."""
        rows = samples
        if not layout.in_place:
            rows = np.zeros(len(samples), self._row)
            if len(rows):
                places, sources = self._positions
                _octets(rows)[:, places] = _octets(samples)[:, sources]
        self._normalize_bools(rows, layout)
        return rows

    @cached_property
    def _positions(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the positions of the bytes of values in a row, and in the sample, if these are not the same."""
        from msggen.recordings.decode.layouts import wire_of

        assert self._schema is not None  # noqa: S101 - only rows of CDR are not samples
        assert self.layout is not None  # noqa: S101
        return self.layout.positions, wire_of(self._schema, USUAL).positions

    def _normalize_bools(self, rows: Rows, layout: Layout) -> None:
        """Write 1 for a bool that is neither 0 nor 1, which numpy does not convert."""
        if not len(rows):
            return
        for bools in layout.bools:
            numbers: NDArray[Any] = np.ndarray(len(rows), f"<u{bools.size}", rows, bools.offset, self._row.itemsize)
            if int(np.bitwise_or.reduce(numbers)) & bools.mask:
                octets = _octets(rows)[:, bools.offset : bools.offset + bools.size]
                np.minimum(octets, bools.largest, out=octets)

    # samples of variable size

    def _one_by_one(self, part: Part, missing: Missing | None) -> Decoded:
        from msggen.recordings.decode import values
        from msggen.recordings.decode.layouts import ENCODINGS

        assert self._schema is not None  # noqa: S101 - without a layout there is a definition
        rows, kept = [], []
        data = part.buffer.data
        for index, (start, size) in enumerate(zip(part.starts.tolist(), part.sizes.tolist(), strict=True)):
            sample = bytes(data[start : start + size])
            if sample[:2] not in ENCODINGS or size < HEADER:
                text = f"encapsulation {sample[:2].hex(' ')}, expected CDR"
                leave_out(missing, text, part.log_times[index : index + 1])
                continue
            try:
                rows.append(values.decode(self._schema, sample))
            except values.ValueDecodeError:
                leave_out(missing, "not samples of this definition", part.log_times[index : index + 1])
                continue
            kept.append(index)
        found = np.empty(len(rows), self.dtype)
        for index, row in enumerate(rows):
            found[index] = row
        return Decoded(found, None if len(kept) == len(part.starts) else np.array(kept, np.intp))

    def _dtype(self) -> np.dtype[Any]:
        if self.layout is not None:
            return self.layout.dtype
        assert self._schema is not None  # noqa: S101 - without a layout there is a definition
        from msggen.recordings.decode import values

        return values.dtype_of(self._schema)


_UNKNOWN = 0xFFFF
_USUAL_NUMBER = int.from_bytes(USUAL, "little")


def _fitting(part: Part, size: int, surplus: int, missing: Missing | None) -> NDArray[np.intp] | None:
    """Return the indices of samples of the right size, None for all."""
    sizes = part.sizes
    is_same = not sizes.strides[0]  # it has one element, for all samples
    if not len(sizes) or (size <= sizes[0] <= size + surplus if is_same else _are_within(sizes, size, size + surplus)):
        return None
    fits = (sizes >= size) & (sizes <= size + surplus)
    for other in np.unique(sizes[~fits]).tolist():
        text = f"{other} bytes, expected {size}: not samples of this definition"
        leave_out(missing, text, part.log_times[sizes == other])
    return np.flatnonzero(fits)


@lru_cache(1024)
def _void(size: int) -> np.dtype[Any]:
    """Return the dtype of bytes without fields."""
    return np.dtype(f"V{size}")


def _are_within(sizes: NDArray[np.int64], least: int, most: int) -> bool:
    return int(sizes.min()) >= least and int(sizes.max()) <= most


def _octets(rows: Rows) -> Octets:
    """Return the bytes of each row, as a view."""
    return rows.view(np.uint8).reshape(len(rows), rows.dtype.itemsize)


def _gathered(buffer: Octets, starts: NDArray[np.int64], size: int) -> Octets:
    return _octets(at(buffer, f"V{size}")[starts])
