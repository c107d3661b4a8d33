"""The `sync` command: updates a ROS 2 package of definitions, such as px4_msgs, from the firmware.

`target` finds the package, `contents` reads the firmware's definitions, `scaffold` renders the other files of a
package, `plan` computes the changes, `guard` checks that they are safe, and `write` makes them, all or none.
`run` calls these steps in order; `change` describes a change to the user.
"""
