"""A ROS 2 package of the firmware's definitions, such as px4_msgs, kept in step with the firmware.

`contents` says what belongs into it, `scaffold` what else a package needs, `plan` what there is to do,
`guard` why it must not be done, and `write` does it, all or nothing; `run` goes through them.
"""
