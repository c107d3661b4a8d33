"""ROS 2 beside a link: topics of a vehicle as topics of rclpy, also as standard messages of ROS.

Only `relay` imports rclpy. A type of ROS is found by its name, and compared with a message of a generated package.
"""
