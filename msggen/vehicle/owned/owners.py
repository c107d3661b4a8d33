"""The processes that own links: which ones run, what they say of themselves, and how they are stopped."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from msggen.base.checked import UnexpectedError
from msggen.link.link import LinkError
from msggen.vehicle.owned.greeting import connected
from msggen.vehicle.owned.places import CAN_SHARE, Place, places
from msggen.vehicle.owned.records import LONGEST, RecordError, RecordReader, event_in, event_of
from msggen.vehicle.owned.told import checked_answer, checked_event

_PATIENCE = 5.0
"""The longest wait in s for an answer, and for the end of a process."""


class Running(NamedTuple):
    """A process that owns a link."""

    place: Place
    state: Mapping[str, Any]
    """What it says of itself: `address`, `pid`, `vehicles`, `programs` and so on."""
    problem: str = ""
    """Why it says nothing."""


def running() -> list[Running]:
    """Return the owners of this user. The sockets of those that were killed are left out. Raises LinkError."""
    found = []
    for place in places() if CAN_SHARE else ():
        try:
            found.append(Running(place, _state_of(place)))
        except OSError:  # nobody listens
            continue
        except LinkError as error:
            found.append(Running(place, {}, str(error)))
    return found


def stop(place: Place) -> None:
    """Let an owner end, and wait until it has. Raises LinkError if it does not."""
    try:
        with connected(place.socket) as own:
            own.settimeout(_PATIENCE)
            own.sendall(event_of("stop"))
            while own.recv(1 << 16):
                pass
    except TimeoutError:
        raise LinkError(f"the process that owns the link does not end: see '{place.log}', or kill it") from None
    except OSError:
        return  # it has ended
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        try:
            connected(place.socket).close()
        except OSError:
            return
        time.sleep(0.01)


def _state_of(place: Place) -> Mapping[str, Any]:
    """Return what an owner says of itself. Raises OSError if nobody listens, and LinkError if it does not answer."""
    with connected(place.socket) as own, suppress(OSError, RecordError, UnexpectedError):  # also TimeoutError
        own.settimeout(_PATIENCE)
        own.sendall(event_of("ask", 1, "state"))  # without a hello: an owner of another version would end
        reader, end = RecordReader(LONGEST), time.monotonic() + _PATIENCE
        while (chunk := own.recv(1 << 16)) and time.monotonic() < end:
            for *_, body in reader.add(chunk):
                with suppress(RecordError):
                    name, values = event_in(body)
                    if name == "answer":
                        state: Mapping[str, Any] | None = checked_answer("state", checked_event(name, values)[1])
                        if state is None:
                            raise UnexpectedError("it does not know the question")
                        return state
    raise LinkError("it does not answer")
