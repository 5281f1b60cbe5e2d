"""What `rtshcua show` prints: one file for each thing that can be shown."""
