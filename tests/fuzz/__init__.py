"""Campaigns of hostile inputs: random cases, each made from a seed and an index, and checked for a wrong outcome.

A campaign is a module with a function `case`, which makes a case from random numbers, a function `check`, which raises
an error if the outcome is wrong, and `COUNT`, the number of cases that the tests run. CONTRIBUTING.md describes them.
"""
