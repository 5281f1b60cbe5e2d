"""The offline audit of a log (`audit.audit`). It needs only the log and one pinned public key."""
