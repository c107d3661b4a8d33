"""`msggen doctor`: why nothing arrives from a vehicle.

`observe` watches a link and returns an Observation, which is immutable. The rules are functions from a Case, which is
an observation and what the user expects, to findings. They need no sockets and no clock.
"""
