"""Cases on both sides of every limit that a policy has: `generation` writes them as tests.

The decision's own machinery finds a limit (`clause_limits`, `zone_edges`, `limit_search`); where another part of its
condition hides it, `pivot` finds a situation in which it matters; `blocks` and `draft` write it. What is expected is
what was decided when the case was run.
"""
