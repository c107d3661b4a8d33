"""MCAP files (https://mcap.dev/spec): reading and writing them."""
