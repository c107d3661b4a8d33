"""The generators of packages from a catalog, with a folder for each language."""
