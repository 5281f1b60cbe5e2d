"""The runtime: mission controller, state monitor, supervisor, fallbacks. Sans-I/O: events in, actions out.

docs/runtime.md shows its stages, and which class owns which state.
"""
