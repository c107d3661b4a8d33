"""Which files belong to a catalog, and their contents: a tree, a package, a revision, an archive or a release in.

A `Catalog` comes out: `read.py` is the whole way. Settings and boards stand beside it. It imports base and
definitions.
"""
