"""The interface between the formats of recordings and what reads them: channels, and arrays of where samples are.

It imports no other room, and is what a new format implements.
"""
