"""The front of samples in CDR (docs/wire.md, section 5), without the layouts behind it."""

HEADER = 4
"""The size of the encapsulation header."""
SURPLUS = 3
"""DDS fills samples up to a multiple of four bytes."""
USUAL = b"\0\1"
"""Little-endian XCDR1, in which PX4 writes."""
