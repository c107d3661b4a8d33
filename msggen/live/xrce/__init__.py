"""DDS-XRCE, the protocol that PX4's client speaks: bytes and a clock in, bytes and events out. Standard library only."""
