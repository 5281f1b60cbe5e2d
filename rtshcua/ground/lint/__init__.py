"""Habits: what compiles, and is worth a second look.

One file a rule, each a function from a `Subject` to findings; `lint` runs them. They speak only of files that were
asked for, never of those that these import: a library is there to be imported, and is somebody else's.
"""
