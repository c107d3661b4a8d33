"""Hypothesis strategies for random definitions such as PX4's, and random values of their messages."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from msggen.definitions.model import ArrayKind, Catalog, FieldType, Message
from msggen.definitions.primitives import INTEGERS, PRIMITIVES

FIXED_SIZE = ("bool", *INTEGERS, "float32", "float64")
LENGTHS = st.sampled_from([1, 2, 3, 4, 5, 8, 15, 16, 17, 33])


@st.composite
def definitions(draw: st.DrawFn) -> dict[str, str]:
    """Return files of up to five messages; later ones nest earlier ones."""
    files = {}
    for number in range(draw(st.integers(1, 5))):
        lines = ["uint64 timestamp"]
        for index in range(draw(st.integers(0, 7))):
            earlier = [f"Message{before}" for before in range(number)]
            name = draw(st.sampled_from([*FIXED_SIZE, *earlier * 3]))
            most = st.sampled_from([1, 2, 3]) if name.startswith("Message") else LENGTHS
            array = f"[{draw(most)}]" if draw(st.booleans()) else ""
            lines.append(f"{name}{array} field{index}")
        draw(st.randoms(use_true_random=False)).shuffle(lines)
        files[f"msg/Message{number}.msg"] = "\n".join(lines) + "\n"
    return files


def scalar(name: str) -> st.SearchStrategy[Any]:
    if name == "bool":
        return st.booleans()
    if name in INTEGERS:
        return st.integers(*PRIMITIVES[name].integer_range)
    return st.floats(width=32 if name == "float32" else 64, allow_nan=True)


def values_of(catalog: Catalog, message: Message) -> st.SearchStrategy[dict[str, Any]]:
    def one(type_: FieldType) -> st.SearchStrategy[Any]:
        if type_.is_primitive:
            return scalar(type_.name)
        return values_of(catalog, catalog.nested(message, type_))

    def field(type_: FieldType) -> st.SearchStrategy[Any]:
        if type_.array is ArrayKind.SCALAR:
            return one(type_)
        return st.lists(one(type_), min_size=type_.length, max_size=type_.length)

    return st.fixed_dictionaries({item.name: field(item.type) for item in message.fields})
