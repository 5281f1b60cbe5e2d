"""From sources to what is signed: what is imported, checked, proved, compiled, tested and pinned, in that order."""
