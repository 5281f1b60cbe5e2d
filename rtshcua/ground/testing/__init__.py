"""Tests of policies: what they mean, how they are run, and how much of a policy they reach.

`case` what is decided on, `suite` a program's cases, `run` decides them, `coverage` and `boundaries` what is missing.
"""
