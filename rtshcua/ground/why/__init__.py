"""Why a decision is what it is.

`trace` tells it step by step, `reads` what its conditions read; `nominal` makes a state to begin from, `given` changes
it by hand, `recorded` takes one from a log.
"""
