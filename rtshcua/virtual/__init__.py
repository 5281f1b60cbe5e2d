"""Whole flights in one process and in virtual time: the simulated vehicle behind the real driver, loop and runtime.

For tests and campaigns, the users' own too; nothing here reads a clock, draws chance, or touches a file or a socket.
"""
