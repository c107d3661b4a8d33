"""The firmware's own EmPy templates, run unchanged: what its generator scripts do, on msggen's model."""
