"""Flight modes, executors and actions in Python. See docs/flight.md."""
