"""The version of msggen."""

__version__ = "0.1.0"
