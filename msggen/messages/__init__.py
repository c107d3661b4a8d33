"""What messages are called and mean: names, values by paths, conditions, messages as text, a vehicle's firmware.

The lists of modes, commands, refusals and setpoints stand here. A generated package is an argument. It imports base and
link, opens no link and starts no thread.
"""
