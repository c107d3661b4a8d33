"""The `bump` command: the steps that PX4's translation node needs for a new version of a message.

`version_step` gathers the inputs, `archived_version` archives the old definition, `header` writes the translation
between old and new, `edits` plans the files to write, `advice` lists the steps that remain, and `write` writes
the files.
"""
