"""Samples as rows of numpy arrays, by the definition that a recording has of them."""
