"""The enforcement boundary: `load` once, `enforce` bytes for bytes, and the executor through which everything is
sent.
"""
