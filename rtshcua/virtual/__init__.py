"""Whole flights in one process and in virtual time: the simulated vehicle behind the real driver, loop and runtime.

For tests and campaigns, including those of users. No code here reads a clock or touches a file or a socket; random
choices come from a given seed.
"""
