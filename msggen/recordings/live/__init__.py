"""A running vehicle recorded, and a recording played as if a vehicle published it."""
