"""Parsers of definitions, comments, `dds_topics.yaml`, CMake lists, Kconfig, package.xml and C++ headers."""
