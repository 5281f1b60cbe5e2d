"""Audit of a log, offline, with nothing but the log and one pinned public key: `audit.audit`."""
