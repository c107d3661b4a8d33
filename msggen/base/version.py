"""The version of msggen."""

__version__ = "1.0.0rc1"
