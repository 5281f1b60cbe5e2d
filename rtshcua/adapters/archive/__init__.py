"""The archive: copies of many logs, verified, with an index for queries (extra `archive`)."""
