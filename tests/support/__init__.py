"""Helpers for the tests in several folders."""
