"""Commander's part of a simulated vehicle: modes, registrations, arming checks and failsafes, as PX4 v1.15 to v1.18.

It knows no messages and no motion. `Commander` is given times in us, commands, and what the sensors tell (`Senses`).
"""
