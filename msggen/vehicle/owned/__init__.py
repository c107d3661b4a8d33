"""The link of another process, which owns it for all programs of a user: finding, joining, asking and leaving it."""
