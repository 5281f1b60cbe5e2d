"""One file a subject; the first line of each says which codes it reports. `check.py` calls their checks in order."""
