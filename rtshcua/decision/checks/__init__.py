"""Checks that a flat policy or mission is well-formed. A signature proves who made a bundle, not that it is
consistent.

Each function yields the problems that it finds, the most serious first; `prepare` refuses on the first. A policy
or mission without problems can be compiled and decided without failure.
"""
