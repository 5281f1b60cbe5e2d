"""Whole flights in one process and in virtual time: the simulated vehicle behind the real driver, loop and runtime.

For tests and campaigns, the users' own too. Nothing here reads a clock or touches a file or a socket; what is left to
chance is drawn by a seed that is given.
"""
