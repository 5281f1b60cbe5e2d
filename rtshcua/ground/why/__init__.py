"""Why a decision is what it is.

`trace` tells it step by step, with what its conditions read; `assumed_state` makes a state to begin from, changed by
hand where that is wanted; `logged_decisions` takes one from a log.
"""
