"""What the verbs of `rtshcua archive` share."""
