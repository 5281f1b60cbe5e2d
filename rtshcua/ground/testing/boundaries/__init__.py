"""Generates tests with cases on both sides of every limit of a policy (`generation`).

`clause_limits`, `zone_edges` and `limit_search` find limits with the code of the decision. If another part of the
condition hides a limit, `pivot` finds a situation in which it matters. `blocks` and `draft` write the tests, which
expect the present decisions.
"""
