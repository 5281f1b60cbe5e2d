"""Tests of policies: what they mean, how a case is decided, how much of a policy cases reach, and generated tests.

`case_lowering` and `scenario_lowering` make cases and scenarios of a program, `case_result` decides a case,
`clause_coverage` adds up what cases reach, `boundaries` generates the tests that are missing.
"""
