"""`msggen view`: a vehicle or a recording in Foxglove, over its websocket."""
