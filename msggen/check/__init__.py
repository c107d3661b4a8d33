"""What is wrong with definitions, or differs between two sets: catalogs in, findings out.

`finding.py` is what a finding is; `run.py` are the commands `check`, `breaking` and `lint`. It imports base,
definitions and sources, and knows no format of output.
"""
