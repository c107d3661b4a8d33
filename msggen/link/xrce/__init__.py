"""DDS-XRCE, the protocol that PX4's client speaks: bytes and time in, bytes and events out. Standard library only."""
