"""Folders and databases of rosbag2."""
