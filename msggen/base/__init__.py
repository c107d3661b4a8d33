"""What all rooms use: locations, errors and foreign text, the disk, processes, the table of rooms.

In come paths and texts, out go `Diagnostic` and `InputError` with their locations, and files that are written whole or
not at all. It imports no other room.
"""
