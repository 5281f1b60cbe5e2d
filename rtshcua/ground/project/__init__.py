"""A project of sources: what its `rtshcua.toml` says, and which files a pattern there means. Pure."""
