"""Reading of a PX4-Autopilot tree, a px4_msgs package or folders of definitions into a catalog.

`sources` finds the files. It imports little, because a build with nothing to do needs no other module. `catalog` reads
the files. `conventions` has the differences between the releases of the firmware.
"""
