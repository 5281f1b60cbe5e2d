"""Files on this machine's disk: replace them atomically, and safely open files that others may have placed there."""
