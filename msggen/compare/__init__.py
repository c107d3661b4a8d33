"""Comparison of two catalogs: rules and their findings. Reading sources and printing findings belong elsewhere."""
