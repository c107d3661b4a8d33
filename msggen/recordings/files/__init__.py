"""The formats of recordings: a module for each, which finds where the samples are."""
