"""The commands of `rtshcua`, one file for each."""
