"""The Python backend: classes, codecs and a registry of topics as source."""
