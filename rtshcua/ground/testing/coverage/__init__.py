"""What the tests of a policy reach of it, by clause and outcome: never by line, so that no formatting changes it.

`universe` says what there is to reach, `reached` what one decision reached, `coverage` adds many up.
"""
