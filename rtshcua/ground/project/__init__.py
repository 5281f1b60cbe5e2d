"""The configuration of a project: reading `rtshcua.toml`, and matching its file patterns."""
