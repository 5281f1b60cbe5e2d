"""The commands of `rtshcua`, one file a command."""
