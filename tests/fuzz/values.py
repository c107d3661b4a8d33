"""Hostile Python values for a field of a message, a nested one too.

`encode` gives bytes that decode to the same value, or EncodeError that names the field. A value is never changed to
fit, and a set or a dict is no array.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from random import Random
from typing import Any, NamedTuple

import numpy as np

from fuzz.payloads import targets
from msggen.definitions.model import ArrayKind, FieldType, Message
from msggen.definitions.primitives import INTEGERS
from support.hostile_values import NUMPY, evaluated, random_expression

COUNT = 6000

OCTETS = ("uint8", "byte", "char")

FEW = 1000
"""The bound of a sequence up to which its values must be counted before they are copied."""

LONGEST = 2000
"""The most characters of an error."""

NESTED = ("cls()", "other()", "None", "sub()", "cls", "cls.decode(cls().encode())", "cls.__new__(cls)", "{}", "lazy()")
"""Expressions for a nested message."""


class Case(NamedTuple):
    """An expression for the value of a field. `path` has the fields that lead to a field of a nested message."""

    message: str
    path: tuple[str, ...]
    value: str


def case(chance: Random) -> Case:
    name = chance.choice(list(targets()))
    codec, message, cls = targets()[name]
    if hasattr(cls, "__layout__") and chance.random() < 0.1:
        return Case(name, (), _rows(chance, [field.name for field in message.fields]))
    path: list[str] = []
    while message.fields:
        field = chance.choice(message.fields)
        path.append(field.name)
        if field.type.is_primitive or (field.type.array is not ArrayKind.SCALAR and not field.type.length):
            break
        if chance.random() < 0.3:
            return Case(name, tuple(path), _nested(chance, field.type.length))
        if field.type.array is not ArrayKind.FIXED and field.type.array is not ArrayKind.SCALAR:
            break
        message = codec.catalog.nested(message, field.type)
    if not path:
        return Case(name, (), "rows(1)")
    length = None if field.type.array is ArrayKind.SCALAR else min(field.type.length or chance.randint(0, 5), 1000)
    is_limited = field.type.array in (ArrayKind.SCALAR, ArrayKind.FIXED) or 0 < field.type.length < FEW
    return Case(name, tuple(path), random_expression(chance, length, is_limited=is_limited))


def _nested(chance: Random, length: int | None) -> str:
    one = chance.choice(NESTED)
    several = ("[{x}] * {n}", "({x},) * {n}", "({x},) * ({n} - 1)", "(*({x},) * ({n} - 1), None)", "iter([{x}] * {n})")
    return chance.choice(several).format(x=one, n=length) if length and chance.random() < 0.9 else one


def _rows(chance: Random, names: list[str]) -> str:
    """Return the expression of an array that is like one of samples, or not."""
    some = chance.sample(names, chance.randint(0, len(names)))
    return chance.choice(
        (
            *(
                "rows(3)",
                "rows(0)",
                "rows(4)[::-1]",
                "rows(4)[::2]",
                "rows(4).reshape(2, 2)",
                "rows(3)[0]",
                "rows(3)[:, None]",
            ),
            *(
                f"rows(3)[{some}]",
                f"rows(3)[{[*some, *names]}]",
                "np.ma.array(rows(3))",
                "rows(3).view(np.recarray)",
                "None",
            ),
            *(
                f"np.zeros(3, [(name, '{chance.choice(NUMPY)}') for name in {names}])",
                "rows(3).tolist()",
                "np.zeros(3)",
                "[]",
            ),
            *(
                f"np.zeros(3, [(name, 'u1', 10**5) for name in {some}])",
                "np.array(rows(2).tolist(), object)",
                "rows(10**5)[:1]",
            ),
        )
    )


def check_rows(cls: Any, expression: str, error: type[Exception]) -> None:
    """Check that batches encode to samples, or raise an error that names the message."""

    def rows(count: int) -> Any:
        return np.zeros(count, cls.dtype())

    array = evaluated(expression, rows=rows)
    for encode in (cls.encode_batch, cls.from_row):
        try:
            encoded = encode(array)
        except error as found:
            check_error(str(found), [cls.__msg__.name])
            continue
        samples = encoded if isinstance(encoded, list) else [encoded.encode()]
        assert all(cls.decode(sample).encode() == sample for sample in samples)


def check(case: Case) -> None:
    codec, description, cls = targets()[case.message]
    if not case.path:
        if hasattr(cls, "__layout__"):
            check_rows(cls, case.value, codec.errors.EncodeError)
        return
    message = holder = cls()
    inner = description
    for name in case.path[:-1]:
        holder = _one(getattr(holder, attribute(holder, name)))
        inner = codec.catalog.nested(inner, _type(inner, name))
    last = attribute(holder, case.path[-1])
    type_ = _type(inner, case.path[-1])
    classes = {} if type_.is_primitive else _classes(codec.cls(codec.catalog.nested(inner, type_)))
    value = evaluated(case.value, **classes)
    setattr(holder, last, value)
    try:
        encoded = message.encode()
    except codec.errors.EncodeError as error:
        check_error(str(error), [description.name, *case.path])
        return
    decoded = cls.decode(encoded)
    assert decoded.encode() == encoded
    for name in case.path[:-1]:
        decoded = _one(getattr(decoded, attribute(decoded, name)))
    found = getattr(decoded, last)
    if type_.array is not ArrayKind.SCALAR and len(found):
        assert not isinstance(value, (AbstractSet, Mapping)), "it has no order"
        assert type_.name in OCTETS or not isinstance(value, (bytes, bytearray)), "these are no numbers"
    given = evaluated(case.value, **classes)  # again, because encoding uses up an iterator
    assert same(found, given, type_.name), (found, given)


def check_error(text: str, path: list[str]) -> None:
    """Check that a short error names the field."""
    named = [part.partition("[")[0] for part in text.partition(":")[0].split(".")]
    assert named[: len(path)] == path, text
    assert len(text) < LONGEST, text


def attribute(message: Any, name: str) -> str:
    """Return the attribute of the field `name`."""
    return str(next(field.attribute for field in message.__msg__.fields if field.name == name))


def _type(message: Message, name: str) -> FieldType:
    return next(field.type for field in message.fields if field.name == name)


def _one(value: Any) -> Any:
    """Return a nested message, or the first of an array of them."""
    return value[0] if isinstance(value, tuple) else value


def _classes(cls: Any) -> dict[str, Any]:
    """Return what expressions for a nested message of class `cls` may name."""
    has_views = hasattr(cls, "__layout__")
    return {
        "cls": cls,
        "other": targets()["px4_msgs/Rpm"].cls,
        "sub": type("Sub", (cls,), {}),
        "lazy": lambda: cls.lazy(cls().encode()) if has_views else cls(),
    }


def same(found: Any, given: Any, type_: str) -> bool:
    """Whether the decoded value is the given one, in the precision of a float32 if it is one."""
    if hasattr(found, "__msg__"):
        return given is None or bool(found == given) or hasattr(given, "__msg__")
    if isinstance(found, (str, bool)):
        return bool(found == given)
    if isinstance(found, (int, float)):
        return _same_number(found, given, type_)
    values = [*itertools.islice(iter(given), len(found) + 1)]
    return len(found) == len(values) and all(same(*pair, type_) for pair in zip(found, values, strict=True))


def _same_number(found: float, given: Any, type_: str) -> bool:
    if type_ in (*INTEGERS, "byte", "char"):
        return bool(found == int(given))  # an integer or a bool: else it would not have been encoded
    if isinstance(given, np.complexfloating):  # numpy converts it to its real part, with a warning
        given = given.real
    number = float(given)
    if type_ == "float32":
        number = struct.unpack("<f", struct.pack("<f", number))[0]
    return found == number or (math.isnan(found) and math.isnan(number))
