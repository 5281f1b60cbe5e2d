"""The configuration of a project: what its `rtshcua.toml` says, and which files a pattern there matches."""
