"""The live view of a run: drawn by a process of its own, fed over a pipe, so that it can never hold up a flight."""
