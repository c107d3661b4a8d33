"""`msggen top`: a table of the topics of a vehicle, what its user chose to see of it, and its drawing in a terminal.

`rows.py` makes the rows from measurements, `view.py` has what keys do, and both know no terminal.
"""
