"""Comparison of a policy with an earlier version: the differences, their direction, and the check of its version."""
