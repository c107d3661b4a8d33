"""The process that owns a link for other programs.

In come a link and what its programs ask for; out go the samples that each of them follows. It imports the links and the
hub of `live.vehicle`, and runs as a process of its own: `msggen.vehicle.owner.process`.
"""
