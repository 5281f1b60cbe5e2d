"""Explanations of decisions.

`trace` explains a decision step by step, with the values that its conditions read; `assumed_state` makes a state for a
hypothetical decision; `logged_decisions` reads a decision from a log.
"""
