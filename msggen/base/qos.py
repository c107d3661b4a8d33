"""The quality of service of programs."""

from typing import Final

DEPTH: Final = 10
"""How many samples a writer or a reader of a program keeps: the default of ROS 2, `rmw_qos_profile_default`."""
