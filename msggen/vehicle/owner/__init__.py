"""The process that owns a link for other programs.

In come a link and what its programs ask for; out go the samples that each of them follows. It runs as a process
of its own, `msggen.vehicle.owner.process`.
"""
