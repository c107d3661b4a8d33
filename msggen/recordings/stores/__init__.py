"""Object stores: S3, Google Cloud Storage, Azure; and servers of HTTP, which are only read.

A program names an object by its address: `s3://bucket/flight.mcap`. It imports obstore, of the extra `stores`, as the
client of stores; servers are read with the standard library.
"""
