"""Files on disk: what the tool brings along, what it wrote before, and writing with care."""
