"""The rules about flights, by what they are about. A module each, with its rules in `RULES`.

The modules do not import numpy: commands that only list rules do not need it.
"""
