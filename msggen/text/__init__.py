"""Template engines, and the words that templates share."""
