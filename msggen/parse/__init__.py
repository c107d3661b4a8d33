"""Text to model and facts: definitions, comments, `dds_topics.yaml`, CMake, Kconfig, package.xml and C++ headers."""
