"""What is written from definitions: a catalog in, texts by file name out; `base/disk` writes them.

Packages of types, `render`, `px4-generate`, `sync`, `bump` and `docs` have a folder each. It imports base, definitions,
sources and check.
"""
