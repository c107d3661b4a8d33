"""Samples as columns: of numpy, as tables of Arrow, as text, and what their values mean."""
