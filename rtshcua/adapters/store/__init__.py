"""Files on this machine's disk: how they are replaced, and how what others may have put there is opened."""
