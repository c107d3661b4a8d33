"""A catalog to files: what templates are shown, the templates' environment, and careful writing."""
