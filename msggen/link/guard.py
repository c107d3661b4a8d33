"""A listener that survives its own errors."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from types import SimpleNamespace
from typing import cast

from msggen.link.link import METHODS, Listener, Remote, Route

TOLD = 100
"""The number of different errors of a listener that are told."""


def guarded(listener: Listener) -> Listener:
    """Return a listener that passes everything on to another one, and tells the errors that it raises.

    An error is told by `warned`, once for each line of code that raises one. The link goes on. An error of `warned`
    itself cannot be told by it, and is printed.
    """
    told: set[str] = set()

    def tell(error: Exception) -> None:
        trace = traceback.extract_tb(error.__traceback__)
        place = f"{trace[-1].filename}:{trace[-1].lineno}"
        if place not in told and len(told) < TOLD:
            told.add(place)
            warned(f"error in a callback, at {place}: {type(error).__name__}: {error}")

    def warned(text: str) -> None:
        try:
            listener.warned(text)
        except Exception:  # noqa: BLE001 - the code of the user
            if len(told) < TOLD:
                told.add(f"warned {len(told)}")
                traceback.print_exc()

    def sample(remote: Remote, route: Route, payload: bytes, time: int) -> None:
        try:  # not by `_guarded`: the frequent one would be slower
            take_sample(remote, route, payload, time)
        except Exception as error:  # noqa: BLE001 - the code of the user
            tell(error)

    take_sample = listener.sample
    methods = {name: _guarded(getattr(listener, name), tell) for name in METHODS.values()}
    return cast("Listener", SimpleNamespace(**{**methods, "sample": sample, "warned": warned}))


def _guarded(method: Callable[..., None], tell: Callable[[Exception], None]) -> Callable[..., None]:
    def pass_on(*arguments: object) -> None:
        try:
            method(*arguments)
        except Exception as error:  # noqa: BLE001 - the code of the user
            tell(error)

    return pass_on
