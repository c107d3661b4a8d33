"""ULogs, the logs that PX4 writes on a vehicle."""
