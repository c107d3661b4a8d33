"""Random changes of texts and bytes, for the campaigns of tests/fuzz."""

from __future__ import annotations

import re
from collections.abc import Sequence
from random import Random

BYTES = (
    *(b"\0", b"\xff", b"\x80", b"\xef\xbb\xbf", b"\r\n", b"\n", b"\t", b" ", b"\x1b", b"\xe2\x80\xa8", b"\xed\xa0\x80"),
    *(b"\xf0\x9f\x9a\x81", b'"', b"'", b"\\", b"[", b"]", b"{", b"}", b"#"),
)
"""Bytes that readers of texts may stumble over."""

NUMBERS = (
    *(b"-1", b"0", b"1", b"127", b"128", b"255", b"256", b"65535", b"65536", b"4294967295", b"4294967296"),
    *(b"9223372036854775808", b"1e400", b"-0", b"0x10", b"1_0", b"nan", b"inf", b"9" * 400, b"9" * 5000),
)
"""Numbers at the ends of ranges and beyond all of them."""

LARGEST = 120_000
"""The most bytes that a mutation makes, so that a reader whose time is not linear exceeds the limit of a case."""


_CHANGES = ("remove", "double", "insert", "insert", "replace", "replace", "repeat", "shuffle", "splice", "flip")
_WORD = re.compile(rb"[\w./-]+")


class Mutator:
    """Changes bytes. `words` are tokens to insert, `others` texts from which parts are taken."""

    def __init__(self, words: Sequence[bytes], others: Sequence[bytes]) -> None:
        self.words = words
        self.others = others

    def mutated(self, chance: Random, data: bytes) -> bytes:
        """Return `data` after up to eight changes."""
        for _ in range(chance.choice((0, 1, 1, 1, 2, 2, 3, 5, 8))):
            start = chance.randint(0, len(data))
            longest = len(data) if chance.random() < 0.2 else 12
            end = min(len(data), start + chance.randint(0, longest))
            data = self._changed(chance, data, start, end)[:LARGEST]
        return data

    def _changed(self, chance: Random, data: bytes, start: int, end: int) -> bytes:
        before, part, after = data[:start], data[start:end], data[end:]
        match chance.choice(_CHANGES):
            case "remove":
                part = b""
            case "double":
                part += part
            case "insert":
                part = self._token(chance) + (part if chance.random() < 0.5 else b"")
            case "replace":
                word = _WORD.search(after)
                after = after[: word.start()] + self._token(chance) + after[word.end() :] if word else after
            case "repeat":
                part = self._repeated(chance, part[:64])
            case "shuffle":
                lines = data.split(b"\n")
                before, part, after = b"", b"\n".join(chance.sample(lines, chance.randint(0, len(lines)))), b""
            case "splice":
                other = chance.choice(self.others)
                after = other[chance.randint(0, len(other)) :]
            case "flip":
                part = bytes(byte ^ 1 << chance.randrange(8) for byte in part)
        return before + part + after

    def _token(self, chance: Random) -> bytes:
        return chance.choice((*self.words, *self.words, *BYTES, *NUMBERS, chance.randbytes(chance.randint(1, 4))))

    def _repeated(self, chance: Random, part: bytes) -> bytes:
        """Return a part, a token or two tokens many times."""
        piece = chance.choice((part, self._token(chance), self._token(chance) + self._token(chance))) or b" "
        size = chance.choice((4, 40, 400, 4, 40, 400, 400, 4000, 100_000))
        return piece * (size // len(piece))
