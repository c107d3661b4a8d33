"""A PX4 vehicle in ROS 2 without an agent: programs for `ros2 run` and `ros2 launch`."""
