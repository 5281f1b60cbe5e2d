"""Cases on both sides of every limit that a policy has: `generate` writes them as tests.

A limit is found by the decision's own machinery (`limits`, `edges`, `moments`), made to matter where another part of
its condition hides it (`pivot`), and written (`written`, `suite`). What is expected is what was decided when the case
was run; nothing is expected that was not.
"""
