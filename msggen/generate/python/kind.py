"""The Python types that hold the values of fields."""

from __future__ import annotations

from enum import Enum
from functools import lru_cache

from msggen.definitions.model import ArrayKind, FieldType
from msggen.definitions.primitives import OCTETS, STRINGS

ARRAY_FROM = 16
"""The length from which fixed arrays of numbers are held as array.array (docs/design_inside.md measures it)."""


class Kind(Enum):
    """The kind of Python object that holds the value of a field."""

    SCALAR = "one number, bool, text or message"
    BYTES = "bytes"
    TUPLE = "tuple"
    ARRAY = "array.array"


@lru_cache(maxsize=4096)
def kind_of(type_: FieldType) -> Kind:
    """Return the kind of Python object that holds the value of a field of this type."""
    if type_.array is ArrayKind.SCALAR:
        return Kind.SCALAR
    if not type_.is_primitive or type_.name == "bool" or type_.name in STRINGS:
        return Kind.TUPLE
    if type_.name in OCTETS:
        return Kind.BYTES
    is_short = type_.array is ArrayKind.FIXED and type_.length < ARRAY_FROM
    return Kind.TUPLE if is_short else Kind.ARRAY
