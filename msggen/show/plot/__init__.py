"""`msggen topic plot`: fields of a running vehicle over time, in a terminal.

`fields.py` finds the numbers that a path names, `samples.py` keeps those of a window, and `drawing.py` draws them as
lines of text. None of them knows a vehicle.
"""
