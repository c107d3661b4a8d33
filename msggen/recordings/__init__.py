"""Recordings of vehicles in MCAP files: [record.md](../../docs/record.md).

`writer.py` writes a file, `recorder.py` writes what arrives from a vehicle, and `reader.py` and `player.py` play it.
They need the packages of the extra `msggen[recordings]`, except `choice.py` and `recorder.py` until a file is opened.
"""
