"""Why nothing arrives from a vehicle, for `msggen doctor`: a link in, findings out.

`watching.py` watches a link and returns an Observation, which is immutable. The rules are functions from a Case, which
is an observation and what the user expects, to findings. They need no sockets and no clock. It imports base,
definitions, check, link, messages and vehicle.
"""
