"""What is proved of a lowered policy and of the missions under it: `proofs` calls all proofs in their order.

The proofs ask the rules of `rtshcua.decision` over sets of values: a step's arguments are known, the state of the
vehicle is not. A proof does not replace the decision on board, which is made again.
"""
