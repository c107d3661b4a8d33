"""A PX4-Autopilot tree, a px4_msgs package or bare folders to a catalog.

`source` finds the files and is light, because a build with nothing to do gets no further; `catalog` reads
them; `release` has what differs between the firmware's releases.
"""
