"""Comparison of two catalogs: rules and their findings. Other packages read sources and print findings."""
