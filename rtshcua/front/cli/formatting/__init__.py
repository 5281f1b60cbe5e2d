"""The parts of `rtshcua fmt`: one file read, laid out and replaced, and what changed, shown."""
