"""The formats of recordings: a folder for each, whose module `reader` finds where the samples are."""
