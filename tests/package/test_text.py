"""Tests of `text`: reading and packing the text in `char[N]` fields."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=20)


def first_characters(text: str, size: int) -> str:
    """Return the longest start of `text` that fits into `size` bytes."""
    return next(text[:end] for end in range(len(text), -1, -1) if len(text[:end].encode()) <= size)


@given(raw=st.binary(max_size=130))
def test_any_bytes_are_text(px4_types: Any, raw: bytes) -> None:
    before_zero = raw[: raw.index(0)] if 0 in raw else raw
    text = px4_types.text.of(raw)
    assert text == before_zero.decode("utf-8", "replace")
    kinds: list[Any] = [bytearray(raw), memoryview(raw), list(raw), np.frombuffer(raw, np.uint8)]
    assert {px4_types.text.of(value) for value in kinds} == {text}


@given(text=TEXTS, size=st.integers(0, 40))
def test_packing_keeps_the_text_or_refuses_it(px4_types: Any, text: str, size: int) -> None:
    packed = px4_types.text.pack(text, size, cut=True)
    assert len(packed) == size
    assert px4_types.text.of(packed) == first_characters(text, size)
    if len(text.encode()) <= size:
        assert px4_types.text.pack(text, size) == packed
    else:
        with pytest.raises(ValueError, match=f"has {len(text.encode())} bytes and the field {size}: shorten it"):
            px4_types.text.pack(text, size)


def test_packed_text_encodes(px4_types: Any) -> None:
    cls = px4_types.DebugKeyValue
    message = cls.decode(cls(key=px4_types.text.pack("speed", 10)).encode())
    assert px4_types.text.of(message.key) == "speed"
    assert px4_types.text.of("abc\0def") == "abc"


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (b"abc", TypeError, "expected a str, got an object of type bytes"),
        ("a\0b", ValueError, "zero character at index 1"),
        ("a\ud800", ValueError, "unpaired surrogate at index 1"),
    ],
)
def test_what_is_no_text_is_refused(px4_types: Any, value: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        px4_types.text.pack(value, 8)


def test_a_negative_size_is_an_error(px4_types: Any) -> None:
    with pytest.raises(ValueError, match=r"^expected a size from 0, got -1$"):
        px4_types.text.pack("abc", -1, cut=True)


@pytest.mark.parametrize("value", [None, 5, 1.5])
def test_what_is_no_value_of_a_field_is_refused(px4_types: Any, value: Any) -> None:
    with pytest.raises(TypeError):
        px4_types.text.of(value)
