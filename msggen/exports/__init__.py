"""What is made of recordings and written: files in other formats, fleets, reports; recording and playing."""
