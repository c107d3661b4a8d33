"""Changes of single lines of msggen, which tests should notice: `python -m tests.mutants`."""
