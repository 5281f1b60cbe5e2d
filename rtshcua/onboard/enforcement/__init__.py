"""The enforcement boundary: `load` once, `enforce` bytes for bytes, and the executor that nothing is sent without."""
