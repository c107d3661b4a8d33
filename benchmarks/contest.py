"""Prepares a peer and a sample for timing: runs the peer's program and checks its results."""

from __future__ import annotations

from typing import Any, NamedTuple

from messages import HEADER, Sample
from msggen.definitions.model import ArrayKind, FieldType, Message
from peers import FLOOR, OURS, CannotError, Peer
from rounds import Contestant

SURPLUS = 3
"""Surplus bytes that are accepted, because some peers pad samples to a multiple of 4."""


class Entry(NamedTuple):
    """The contestants of a peer, or the reasons why it does not take part."""

    decode: Contestant | str
    encode: Contestant | str


class WrongError(Exception):
    """A peer has a wrong result."""


def enter(peer: Peer, sample: Sample) -> Entry:
    """Return how `peer` decodes and encodes `sample`, after comparing the results with msggen's."""
    names: dict[str, Any] = {"__name__": "contest", "data": sample.payload}
    try:
        execute(peer.program(sample), names)
        names["message"] = evaluate(peer.decode, names)
        check_values(peer, sample, names["message"])
    except Exception as error:  # noqa: BLE001 - an error of one peer must not stop the others
        return Entry(reason(error), reason(error))
    decode = Contestant(peer.decode, dict(names))
    try:
        names["message"] = evaluate(peer.prepare, names)
        check_bytes(sample, evaluate(peer.encode, names))
    except Exception as error:  # noqa: BLE001 - likewise
        return Entry(decode, reason(error))
    return Entry(decode, Contestant(peer.encode, names))


def execute(program: str, names: dict[str, Any]) -> None:
    """Run one of the programs in peers.py as a module of its own."""
    exec(compile(program, names["__name__"], "exec", dont_inherit=True), names)  # noqa: S102 - see above


def evaluate(expression: str, names: dict[str, Any]) -> Any:
    """Return the value of one of a peer's expressions."""
    return eval(expression, names)  # noqa: S307 - text from peers.py too


def reason(error: Exception) -> str:
    """Return a short reason why a peer does not take part."""
    if isinstance(error, ModuleNotFoundError):
        return "is not installed"
    if isinstance(error, CannotError):
        return str(error)
    return f"{error.__class__.__name__}: {error}".splitlines()[0]


def check_values(peer: Peer, sample: Sample, decoded: Any) -> None:
    """Raise WrongError unless `decoded` has the values that msggen decodes."""
    if peer in (OURS, FLOOR):
        return
    names: dict[str, Any] = {"__name__": "contest", "data": sample.payload}
    execute(OURS.program(sample), names)
    expected = plain_message(sample, sample.message, evaluate(OURS.decode, names), signed_char=False)
    found = plain_message(sample, sample.message, decoded, signed_char=peer.signed_char)
    for name, value in expected.items():
        if found[name] != value:
            raise WrongError(f"decodes {name} to another value")


def check_bytes(sample: Sample, encoded: Any) -> None:
    """Raise WrongError unless `encoded` is the sample, apart from padding at its end."""
    written = bytes(encoded)
    rest = written[len(sample.payload) :]
    if written[: len(HEADER)] != HEADER or len(rest) > SURPLUS or written.removesuffix(rest) != sample.payload:
        raise WrongError("encodes other bytes")


def plain_message(sample: Sample, message: Message, decoded: Any, *, signed_char: bool) -> dict[str, Any]:
    """Return a decoded message of any package as dictionaries, lists and numbers."""
    return {
        field.name: _plain(sample, message, field.type, getattr(decoded, field.name), signed_char=signed_char)
        for field in message.fields
    }


def _plain(sample: Sample, outer: Message, type_: FieldType, value: Any, *, signed_char: bool) -> Any:
    if not type_.is_primitive:
        inner = sample.catalog.nested(outer, type_)
        if type_.array is ArrayKind.SCALAR:
            return plain_message(sample, inner, value, signed_char=signed_char)
        return [plain_message(sample, inner, item, signed_char=signed_char) for item in value]
    if hasattr(value, "tolist"):
        value = value.tolist()
    if type_.array is ArrayKind.SCALAR:
        return value
    return [item & 0xFF for item in value] if type_.name == "char" and signed_char else list(value)
