"""Columns of structured arrays: one array for each number, named as pyulog names them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from msggen.base.diagnostics import suggestion
from msggen.recordings.source.source import RecordingError, UnknownFieldError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from numpy.typing import NDArray

_ROWS = 2048
"""The rows that are copied at a time: they should fit into the processor's caches."""
_END_OF_NAME = re.compile(r"[.\[]")


def columns_of(rows: NDArray[Any], fields: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Return copies of the columns by name, such as `gyro_rad[0]` and `esc[7].esc_rpm`.

    `fields` chooses, in its order: `esc` is all of it, `esc[7]` one element, `esc[7].esc_rpm` one column. Raises
    RecordingError for an unknown field, or for more than MAX_TOTAL columns. A column is of numbers,
    or of objects where the values have no fixed size.
    """
    from msggen.definitions.nesting import MAX_TOTAL

    count = len(rows)
    if count_of(rows.dtype) > MAX_TOTAL:
        raise RecordingError(f"{count_of(rows.dtype)} columns, up to {MAX_TOTAL} can be made: use the array of rows")
    wanted = None if fields is None else set(fields)
    found: dict[str, NDArray[Any]] = {}
    paths: dict[str, NDArray[Any]] = {}
    for path, field in _leaves(rows[:0], ""):
        if field.ndim == 1 or field.dtype == object:
            names = [path]
        else:
            names = [f"{path}[{index}]" for index in range(field.shape[1])]
        taken = [name for name in names if wanted is None or _is_chosen(name, wanted)]
        if taken:
            block = np.empty((*field.shape[1:], count), field.dtype.newbyteorder("="))
            paths[path] = block
            columns = {path: block} if names == [path] else dict(zip(names, block, strict=True))
            found.update((name, columns[name]) for name in taken)
    if fields is not None:
        check_fields(rows.dtype, fields)
        found = {name: found[name] for field in fields for name in found if field in _fronts(name)}
    for start in range(0, count, _ROWS):
        part = rows[start : start + _ROWS]
        for path, field in _leaves(part, ""):
            if path in paths:
                paths[path][..., start : start + _ROWS] = field.T
    return found


def count_of(dtype: np.dtype[Any]) -> int:
    """Return how many columns a dtype has."""
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        return count_of(base) * int(np.prod(shape))
    return sum(count_of(field) for field, *_ in dtype.fields.values()) if dtype.fields is not None else 1


def names_of(dtype: np.dtype[Any]) -> list[str]:
    """Return the names of the columns of a dtype, in order."""
    return list(columns_of(np.empty(0, dtype)))


def check_fields(dtype: np.dtype[Any], fields: Collection[str]) -> None:
    """Raise RecordingError for a name that no column of `dtype` has or begins with, TypeError for no name."""
    names = names_of(dtype)
    for field in fields:
        if not isinstance(field, str):
            raise TypeError(f"fields: expected names, got {field!r}")
        if not has_field(dtype, field):
            near = sorted({front for name in names for front in _fronts(name)})
            raise UnknownFieldError(f"no field is called '{field}'{suggestion(field, near)}")


def has_field(dtype: np.dtype[Any], field: str) -> bool:
    """Whether a column of `dtype` has the name `field` or begins with it."""
    return any(_is_chosen(name, {field}) for name in names_of(dtype))


def _is_chosen(name: str, wanted: Collection[str]) -> bool:
    return any(front in wanted for front in _fronts(name))


def _fronts(name: str) -> Iterator[str]:
    """Yield `esc`, `esc[7]` and `esc[7].esc_rpm` for the last."""
    for end in _END_OF_NAME.finditer(name):
        yield name[: end.start()]
    yield name


def _leaves(rows: NDArray[Any], path: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield path and values of each field that is not a message: one dimension, or two for an array."""
    for name in rows.dtype.names or ():
        field, label = rows[name], path + name
        if field.dtype.names is None:
            yield label, field
        elif field.ndim == 1:
            yield from _leaves(field, f"{label}.")
        else:
            for index in range(field.shape[1]):
                yield from _leaves(field[:, index], f"{label}[{index}].")
