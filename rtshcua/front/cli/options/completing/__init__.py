"""Completion data for `rtshcua completion`."""
