"""The output of `rtshcua show`, one module for each kind of file."""
