"""`msggen topic plot`: fields of a running vehicle over time, in a terminal.

`fields.py` finds the numbers that a path names, and keeps those of a window; `drawing.py` draws them as lines of text.
Neither knows a vehicle.
"""
