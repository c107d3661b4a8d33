"""The exit codes of the command line."""

DONE, FINDINGS, FAILED, INTERRUPTED = 0, 1, 2, 130
"""Success, findings or changes, usage, input or I/O errors, and Ctrl-C as shells report it: 128 and SIGINT's number."""
