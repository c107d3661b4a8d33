"""The model of messages, and what follows from it: text in, immutable values, offsets and hashes out.

`parse/` reads definitions without opening files; `model.py` is what all else works on. It imports base.
"""
