"""A running vehicle: its messages in Python, over DDS-XRCE or DDS."""
