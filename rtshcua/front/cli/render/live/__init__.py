"""The live view of a run, drawn by a separate process and fed over a pipe, so that it cannot delay a flight."""
