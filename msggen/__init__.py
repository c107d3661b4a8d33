"""msggen: PX4's message definitions in; Python types, CDR codecs and a topic registry out."""

__version__ = "0.1.0"
