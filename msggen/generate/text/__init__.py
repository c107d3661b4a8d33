"""Template engines, and the filters that templates share."""
