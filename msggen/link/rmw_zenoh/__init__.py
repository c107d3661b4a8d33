"""The form in which rmw_zenoh, and PX4's module `zenoh`, put ROS 2 on Zenoh (docs/zenoh.md). Nothing here does I/O."""
