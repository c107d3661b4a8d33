"""A catalog to a generated package; a folder for each language."""
