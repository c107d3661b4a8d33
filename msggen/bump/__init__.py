"""The manual steps for a new version of a message, as PX4's documentation of its translation node lists them.

`archive` keeps the old definition, `header` translates between old and new, `plan` puts the steps together and knows
what is left to people, `write` carries them out.
"""
