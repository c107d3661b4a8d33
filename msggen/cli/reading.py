"""Errors of recordings and of stores, as commands print them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from msggen.base.diagnostics import InputError, input_error
from msggen.cli.packages import missing_extra

if TYPE_CHECKING:
    from msggen.recordings.stores.errors import StoreError


@contextmanager
def read_errors(path: str) -> Iterator[None]:
    """Raise InputError for a recording that cannot be read."""
    from msggen.recordings.source.source import RecordingError

    try:
        yield
    except RecordingError as error:
        raise input_error(path, "R102", str(error).removeprefix(f"{path} "), 0) from None
    except OSError as error:
        raise input_error(path, "R102", f"cannot be read: {error.strerror}", 0) from None


@contextmanager
def store_errors(code: str) -> Iterator[None]:
    """Raise InputError for an object in a store, and for a package for stores that is not installed."""
    from msggen.recordings.stores.errors import StoreError

    try:
        yield
    except StoreError as error:
        raise store_failed(error, code) from None
    except ModuleNotFoundError as error:
        raise missing_extra(error, "stores", code) from None


def store_failed(error: StoreError, code: str) -> InputError:
    """Return the error about an object in a store."""
    return input_error(str(error.filename), code, str(error.strerror), 0)
