"""A report on a flight: one HTML file with charts, the track, events, parameters and findings."""
