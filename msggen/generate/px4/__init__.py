"""A replacement for the generator scripts of the firmware, which runs its EmPy templates on msggen's model."""
