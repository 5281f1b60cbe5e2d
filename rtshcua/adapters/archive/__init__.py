"""The archive: many logs, copied in and verified, and an index over them that answers questions (extra `archive`)."""
