"""The runtime: mission controller, state monitor, supervisor, fallbacks. Sans-I/O: events in, actions out.

Its stages, and which class owns which state, are drawn in docs/runtime.md.
"""
