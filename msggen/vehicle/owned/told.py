"""What the process that owns a link tells a program: each value is checked here, before anything else sees it.

An owner of another version, or one that is broken or hostile, ends the link of a program with an error for people.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from msggen.base.checked import TIME, UnexpectedError, field, real, row, several, shortened, table, text, truth, whole

Check = Callable[[Any], Any]

_NUMBER: Final = partial(whole, least=1, most=(1 << 32) - 1)
_COUNT: Final = partial(whole, least=0, most=TIME)
_TIME: Final = partial(whole, least=-TIME, most=TIME)
_KEY: Final = partial(whole, least=0, most=(1 << 32) - 1)
_PID: Final = partial(whole, least=-1, most=(1 << 31) - 1)
_OBJECT: Final = partial(whole, least=-1, most=(1 << 16) - 1)
_SIZE: Final = partial(whole, least=-1, most=(1 << 20))
_LONGEST: Final = 1 << 16
"""The characters of the longest message for people."""


def _message(value: object) -> str:
    """Return a text for people. What cannot be encoded, such as a part of a path, is escaped."""
    if not isinstance(value, str) or len(value) > _LONGEST:
        raise UnexpectedError(f"expected a text of at most {_LONGEST} characters, got {shortened(value)}")
    return value.encode("utf-8", "backslashreplace").decode()


def _name(value: object) -> str:
    if not value:
        raise UnexpectedError(f"expected a name, got {shortened(value)}")
    return text(value)


def _one_of(*names: str) -> Check:
    def check(value: object) -> object:
        if value not in names:
            raise UnexpectedError(f"expected {' or '.join(names)}, got {shortened(value)}")
        return value

    return check


def _row(*parts: Check) -> Check:
    return lambda value: row(value, *parts)


def _object(**parts: Check) -> Check:
    return lambda value: {name: part(field(value, name)) for name, part in parts.items()}


def _some(part: Check) -> Check:
    return lambda value: several(value, part, 1 << 16)


def _table(part: Check) -> Check:
    return lambda value: table(value, part, 1 << 16)


def _any(value: object) -> object:
    return value


_REMOTE: Final = _row(_NUMBER, _message, _KEY, text, truth, text)
_ROUTE: Final = _row(_name, _name, _one_of("out", "in"), _OBJECT, text, _KEY)
_SERVICE: Final = _row(_name, _name, _name, _OBJECT)

_EVENTS: Final[Mapping[str, tuple[Check, ...]]] = MappingProxyType(
    {
        "welcome": (_message, _PID),
        "refused": (_message,),
        "leaving": (),
        "connected": (_REMOTE,),
        "disconnected": (_NUMBER, _message),
        "lost": (_NUMBER, _COUNT),
        "identified": (_NUMBER, _table(_KEY), truth),
        "warned": (_message,),
        "failed": (_message,),
        "unsent": (_NUMBER, _COUNT, _message),
        "taken": (_TIME, _COUNT, _TIME, text),
        "answer": (_COUNT, _any),
    }
)
"""The values of each event. Those of `opened` depend on the kind of what is opened."""
_KINDS: Final = MappingProxyType({"Route": _ROUTE, "Service": _SERVICE})

_VEHICLE: Final = _object(
    number=_NUMBER,
    address=_message,
    key=_KEY,
    namespace=_message,
    continued=truth,
    release=_message,
    lost=_COUNT,
    samples=_COUNT,
)
_ANSWERS: Final[Mapping[str, Check]] = MappingProxyType(
    {
        "statistics": _row(*[_COUNT] * 8),
        "state": _object(
            address=_message,
            version=_message,
            pid=_PID,
            age=real,
            vehicles=_some(_VEHICLE),
            programs=_some(_object(name=_message, pid=_PID, age=real, unread=_COUNT, unsent=_COUNT)),
            rate=real,
        ),
        "clients": _some(_row(_message, _KEY, partial(whole, least=0, most=(1 << 32) - 1), real, real, _COUNT)),
        "settled": truth,
        "refusals": _table(_COUNT),
        "publishers": _table(_some(_row(_name, _message, _PID, *[_COUNT] * 3))),
        "warnings": _some(_message),
    }
)


def checked_event(name: str, values: list[Any]) -> list[Any]:
    """Return the values of an event. Raises UnexpectedError."""
    if name == "opened":
        number, kind, described = row(values, _NUMBER, _one_of(*_KINDS), _any)
        return [number, kind, _KINDS[kind](described)]
    if name not in _EVENTS:
        raise UnexpectedError(f"an unknown event {shortened(name)}")
    return row(values, *_EVENTS[name])


def checked_answer(what: str, value: Any) -> Any:
    """Return an answer to a question, None if the owner does not know the question. Raises UnexpectedError."""
    return None if value is None else _ANSWERS[what](value)
