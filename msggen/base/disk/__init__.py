"""Files on disk: bundled resources, records of earlier runs, git, and all writing."""
