"""What `rtshcua completion` knows of the other commands."""
