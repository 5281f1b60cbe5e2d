"""Proofs about a lowered policy and the missions under it. `proofs` runs all of them in order.

The proofs evaluate the rules of `rtshcua.decision` over sets of values: the arguments of a step are known, the state of
the vehicle is not. A proof does not replace the decision on board.
"""
