"""Recordings as users see them: a path in, a `Log` with samples, messages, alignment and pictures out.

It imports all that reads recordings: their files, topics, columns and definitions.
"""
