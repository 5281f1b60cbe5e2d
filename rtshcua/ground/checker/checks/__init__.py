"""The checks, one module for each subject; `check.py` calls them in order."""
