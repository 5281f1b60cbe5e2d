"""Tests of policies: cases and scenarios, their results, the coverage of a policy, and generated tests.

`case_lowering` and `scenario_lowering` lower the tests of a program, `case_result` decides a case, `clause_coverage`
computes coverage, `boundaries` generates tests.
"""
