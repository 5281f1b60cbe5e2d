"""What is proved of a lowered policy and mission: authority, chains, paths and timing. One file a proof.

The rules of `rtshcua.decision` are asked, over sets of values: a step's arguments are known, the vehicle's state is
not. A proof never takes the place of the decision on board, which is made again.
"""
