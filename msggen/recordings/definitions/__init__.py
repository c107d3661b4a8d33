"""The definitions of a recording: compared with others, lent by others, and which release they are of."""
