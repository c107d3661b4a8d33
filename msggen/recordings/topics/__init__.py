"""The topics of a recording: channels in, topics by any of their names out. It imports `source` and `decode`."""
