"""The manual steps for a new version of a message, as PX4's documentation of its translation node lists them.

`archived_version` keeps the old definition, `header` translates between old and new, `version_step` is what is known
of the way from one to the other, `edits` what there is to write, `advice` what is left to people; `write` carries it
out.
"""
